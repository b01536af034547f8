"""Documents of other projects, read into plain data; needs nothing but `core`."""
