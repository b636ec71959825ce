"""The program: `python -m spectroll` is `spectroll`."""

from ._spectroll import main

main()
