"""How many cases hypothesis tries: few in `make test`, many in `make fuzz`."""

import os

EXAMPLES = int(os.environ.get("SNAKEGEN_EXAMPLES", "25"))
