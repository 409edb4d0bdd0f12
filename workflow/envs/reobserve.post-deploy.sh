#!/usr/bin/env bash
# Run by Snakemake in the new environment, from the project's folder.
sh workflow/envs/install.sh
