import signal

from hypothesis import settings

# Kernels compile inside an example on a fresh machine, and a gate must judge the same examples every day.
settings.register_profile("house", deadline=None, derandomize=True)
settings.load_profile("house")

# A background job inherits SIGINT ignored, and tests press Ctrl-C.
signal.signal(signal.SIGINT, signal.default_int_handler)
