"""What an answer to danger consists of: bits that are added up, and their names."""

# PRESENT: brake for who is ahead by now; GO: on through a junction
RESPONSE_BRAKE, RESPONSE_STEER, RESPONSE_PRESENT, RESPONSE_GO = 1, 2, 4, 8


def response_name(response: int) -> str:
    """Name of a sum of RESPONSE_* bits."""
    if response & RESPONSE_GO:
        return "go"
    brakes = response & (RESPONSE_BRAKE | RESPONSE_PRESENT)
    if response & RESPONSE_STEER:
        return "both" if brakes else "lateral"
    return "longitudinal" if brakes else "none"
