"""highway-env's dynamics compiled: thousands of environments at once, with the same trajectories.

One kernel (`engine.run`) advances environments frame by frame. What it computes is in one file per
idea: `sight` (neighbours), `drivers` (decisions), `regulation` (who yields), `motion`, `collisions`, all put
together in `frame`, `guard` (the shield), `rating` (what rewards share), `spawning` (new road users) and `draws`
(random numbers). `envs/` has one file per environment, `tasks` says which there are; `views/` has one per kind of
observation. `threads` share the work. `config` turns a highway-env configuration into numbers, `vector` is the
`gymnasium.vector.VectorEnv`, `warm_up` compiles beforehand.
"""
