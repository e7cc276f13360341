"""Pedestrians as plans see them, and what they owe: Def. 21's reach off crossings, Defs. 14-18 on them."""
