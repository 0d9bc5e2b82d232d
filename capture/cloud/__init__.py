"""Clouds: depth images cleaned, cut to the region of interest, without floor and walls, with normals, fused."""
