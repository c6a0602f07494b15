"""Cameras, rays, the cube they cross and the origin it follows (paper sections 4.4 and 4.6)."""
