"""Options that several verbs have, so that the same ones mean the same everywhere.

`arguments` comes first; each other module has the options of one matter. Commands import the
package as a whole: `options.add_output(parser, ...)`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
