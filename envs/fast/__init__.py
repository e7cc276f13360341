"""highway-env's dynamics compiled: thousands of environments at once, with the same trajectories.

One kernel (`engine.run`) advances environments frame by frame. What it computes is in one file per
idea: `network` (lanes), `sight` (neighbours), `drivers` (decisions), `regulation` (who yields), `motion`,
`collisions`, all put together in `frame`, `guard` (the shield), `observations`, `rewards`, `scenes`
(resets), `traffic_flow` (cars that come and go) and `draws` (random numbers). `threads` share the work.
`config` turns a highway-env configuration into numbers, `vector` is the `gymnasium.vector.VectorEnv`.
"""
