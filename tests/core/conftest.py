"""What tests of the pool have done in workers is imported there, too."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
