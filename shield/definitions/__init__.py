"""The paper, in its order: one short function per definition, no memory, no loops over cars, no frames.

Leaves: they import the parameters, the kinematics, lane frames and boxes (`shield.geometry`), what takes numbers of any
kind (`shield.anything`), how functions are compiled, and other definitions. Defs. 1 to 10 and 14 to 18 stand in
`shield/definitions/longitudinal.py`, `lateral.py`, `response.py` and `right_of_way.py`.
"""
