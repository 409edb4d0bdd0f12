"""The pipeline's stages: each reads files, calls the paper's module and writes files whole."""
