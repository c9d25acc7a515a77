"""The night of a fleet on several machines: jointctl's own steps as Ray tasks, a joint each.

`steps` runs jointctl and is all that a worker needs; `night` orders the tasks; `files` joins what they wrote. All
arithmetic is jointctl's: the files are those of its commands on one machine, byte by byte.
"""
