"""Pages in the browser, on viser; whatever they do is a command of a session in `compose`."""
