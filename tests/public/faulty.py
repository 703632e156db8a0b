"""Wrong uses of the public face; a type checker that sees its types finds every one of them."""

import velodrome

velodrome.run(5)
velodrome.run("q2-plus", horizon=5.0)
velodrome.circular(0.005)
velodrome.Paraboloid("steep")
velodrome.no_such_name
wrong: int = velodrome.__version__
engine: velodrome.Engine = object()
