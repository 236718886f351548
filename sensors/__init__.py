"""One adapter a module: each turns a sensor, folder or recording into a stream of wire messages."""
