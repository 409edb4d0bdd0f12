# One build at a time in a folder. The kernel holds this lock and drops it when the process ends,
# however it ends, so a killed build needs no unlocking (the profile turns Snakemake's own lock,
# which outlives a killed process, off).


onstart:
    take_build_lock()
