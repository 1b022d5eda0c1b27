"""By its import, the first in a fork server, lets that end with the process that started it.

The server itself looks for that end, and ignores SIGINT, only after it has loaded everything.
"""

import os

from blast_env.processes import end_silently_at_interrupt, end_with

end_silently_at_interrupt()
end_with(os.getppid())
