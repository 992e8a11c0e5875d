"""Gaussian splats: files, the OpenCL engine and fitting."""
