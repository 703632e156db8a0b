"""symbrim's equations of the Whipple bicycle as an engine of Velodrome."""
