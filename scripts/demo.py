"""`make demo`; see `studies.demo`."""

from studies.demo import main

if __name__ == "__main__":
    main()
