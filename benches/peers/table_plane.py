#!/usr/bin/env python3
"""Open3D's search for the table in the room that `cargo bench -p ppa-scene` measures: 1000 planes, none left out.

    cargo run -p ppa-benches --example peer_inputs -- INPUTS
    pip install open3d
    benches/peers/table_plane.py INPUTS
"""
import processor_time  # before the libraries

import pathlib
import sys

import open3d

NEAR_MM, PLANES = 10.0, 1000

if len(sys.argv) != 2:
    sys.exit(__doc__)
cloud = open3d.io.read_point_cloud(str(pathlib.Path(sys.argv[1]) / "room.ply"))
open3d.utility.random.seed(1)
# With a probability of 1 the search does not end before its last plane.
seconds, (plane, near) = processor_time.best_of(
    3, lambda: cloud.segment_plane(NEAR_MM, 3, PLANES, probability=1.0)
)
processor_time.report(
    "Open3D segment_plane",
    seconds,
    points=len(cloud.points),
    near=len(near),
    table_mm=round(abs(plane[3] / plane[2]), 2),
)
