"""Who was to blame? Any log is judged afterwards, pair by pair, by the rules that a shield drives by."""
