#!/usr/bin/env python3
"""Embree, as Open3D has it, on the mesh that `cargo bench -p ppa-depth` measures: its tree, and an image without lens.

    cargo run -p ppa-benches --example peer_inputs -- INPUTS
    pip install open3d
    benches/peers/depth_images.py INPUTS
"""
import processor_time  # before the libraries

import pathlib
import sys

import numpy as np
import open3d

WIDTH, HEIGHT, FOCAL = 640, 576, 504.0

if len(sys.argv) != 2:
    sys.exit(__doc__)
mesh = open3d.t.io.read_triangle_mesh(str(pathlib.Path(sys.argv[1]) / "tube.ply"))
# One metre away and turned by 0.2 about y, as in the bench.
turn = np.array([[np.cos(0.2), 0, np.sin(0.2)], [0, 1, 0], [-np.sin(0.2), 0, np.cos(0.2)]])
corners = mesh.vertex.positions.numpy() @ turn.T + [0.0, 0.0, 1000.0]
vertices = open3d.core.Tensor(corners.astype(np.float32))
triangles = open3d.core.Tensor(mesh.triangle.indices.numpy().astype(np.uint32))

across, down = np.meshgrid(np.arange(WIDTH) - WIDTH / 2, np.arange(HEIGHT) - HEIGHT / 2)
ways = np.stack([across / FOCAL, down / FOCAL, np.ones_like(across)], axis=-1)
rays = open3d.core.Tensor(np.concatenate([np.zeros_like(ways), ways], axis=-1).astype(np.float32))


def build():
    scene = open3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(vertices, triangles)
    # The tree is built for the first ray.
    scene.cast_rays(rays[:1, :1], nthreads=1)
    return scene


seconds, scene = processor_time.best_of(5, build)
processor_time.report("Embree, tree of a changed mesh", seconds, triangles=len(triangles))
seconds, hits = processor_time.best_of(10, lambda: scene.cast_rays(rays, nthreads=1))
seen = hits["t_hit"].numpy()
processor_time.report("Embree, image", seconds, pixels=int(np.isfinite(seen).sum()))
