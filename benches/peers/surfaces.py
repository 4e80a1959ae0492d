#!/usr/bin/env python3
"""VTK, SciPy and Open3D on the leg that `cargo bench -p ppa-mesh` measures.

    cargo run -p ppa-benches --example peer_inputs -- INPUTS
    pip install vtk scipy open3d nibabel
    benches/peers/surfaces.py INPUTS [flying_edges|pieces_scipy|pieces_vtk|dbscan]
"""
from processor_time import best_of, each_in_its_own_process, report  # before the libraries

import pathlib

import numpy as np

ISO_HU = -500.0
DBSCAN_MM, DBSCAN_POINTS = 2.0, 10


def leg(folder):
    """The volume as VTK's image; nibabel's first axis runs fastest, as VTK's does."""
    import nibabel
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk

    vtk.vtkSMPTools.Initialize(1)
    scan = nibabel.load(pathlib.Path(folder) / "leg.nii")
    hu = np.asarray(scan.dataobj).astype(np.int16).ravel(order="F")
    image = vtk.vtkImageData()
    image.SetDimensions(scan.shape)
    image.SetSpacing([float(mm) for mm in scan.header.get_zooms()])
    image.GetPointData().SetScalars(numpy_to_vtk(hu, deep=True))
    return image


def surface(image, normals):
    import vtk

    edges = vtk.vtkFlyingEdges3D()
    edges.SetInputData(image)
    edges.SetValue(0, ISO_HU)
    edges.SetComputeNormals(normals)
    edges.ComputeGradientsOff()
    edges.ComputeScalarsOff()
    edges.Update()
    return edges.GetOutput()


def arrays(mesh):
    from vtk.util.numpy_support import vtk_to_numpy

    corners = vtk_to_numpy(mesh.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    return vtk_to_numpy(mesh.GetPoints().GetData()), corners


def flying_edges(folder):
    image = leg(folder)
    seconds, mesh = best_of(20, lambda: surface(image, normals=True))
    report("VTK flying edges with normals", seconds, vertices=mesh.GetNumberOfPoints())


def pieces_scipy(folder):
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    points, corners = arrays(surface(leg(folder), normals=False))

    def pieces():
        ends = corners[:, [0, 1, 1, 2]].reshape(-1, 2).T
        edges = coo_matrix((np.ones(ends.shape[1], bool), tuple(ends)), shape=(len(points),) * 2)
        return connected_components(edges, directed=False)[0]

    seconds, count = best_of(5, pieces)
    report("SciPy connected components", seconds, pieces=int(count))


def pieces_vtk(folder):
    import vtk

    mesh = surface(leg(folder), normals=False)

    def pieces():
        connectivity = vtk.vtkPolyDataConnectivityFilter()
        connectivity.SetInputData(mesh)
        connectivity.SetExtractionModeToAllRegions()
        connectivity.Update()
        return connectivity.GetNumberOfExtractedRegions()

    seconds, count = best_of(5, pieces)
    report("VTK connectivity filter", seconds, pieces=count)


def dbscan(folder):
    import open3d

    points, _ = arrays(surface(leg(folder), normals=False))
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points.astype(float)))
    seconds, labels = best_of(
        3, lambda: np.asarray(cloud.cluster_dbscan(DBSCAN_MM, DBSCAN_POINTS))
    )
    report("Open3D DBSCAN", seconds, points=len(points), clusters=int(labels.max()) + 1)


if __name__ == "__main__":
    cases = (flying_edges, pieces_scipy, pieces_vtk, dbscan)
    each_in_its_own_process({case.__name__: case for case in cases})
