"""A skin with one taxel in NGSolve: an independent geometry, mesh and solver."""

import numpy as np

VACUUM_FF_PER_MM = 8.8541878128


def ngsolve_capacitance(
    ngsolve, layout, *, thickness_mm, poisson, young_mpa, permittivity, load_centre_mm, load_radius_mm, pressure_mpa
):
    """Capacitance in fF of the taxel under an even pressure on a disc of the upper side."""
    from netgen.occ import OCCGeometry

    solid = _solid(layout, thickness_mm, load_centre_mm, load_radius_mm)
    mesh = ngsolve.Mesh(OCCGeometry(solid).GenerateMesh(maxh=1.0, grading=0.4))
    mesh.Curve(3)
    mesh.SetDeformation(_deformation(ngsolve, mesh, poisson, young_mpa, pressure_mpa))
    space = ngsolve.H1(mesh, order=3, dirichlet="taxel|guard|load|top")
    u, v = space.TnT()
    factor = permittivity * VACUUM_FF_PER_MM
    stiffness = ngsolve.BilinearForm(factor * ngsolve.grad(u) * ngsolve.grad(v) * ngsolve.dx).Assemble()
    driven, alone = ngsolve.GridFunction(space), ngsolve.GridFunction(space)
    driven.Set(mesh.BoundaryCF({"taxel": 1.0, "guard": 1.0}, default=0.0), ngsolve.BND)
    alone.Set(mesh.BoundaryCF({"taxel": 1.0}, default=0.0), ngsolve.BND)
    residual = (stiffness.mat * driven.vec).Evaluate()
    driven.vec.data -= stiffness.mat.Inverse(space.FreeDofs(), "sparsecholesky") * residual
    # The charge of the weak form: tested with a function that is 1 on the taxel and 0 on all other electrodes.
    charge = ngsolve.InnerProduct((stiffness.mat * driven.vec).Evaluate(), alone.vec)
    mesh.UnsetDeformation()
    return float(charge)


def _solid(layout, thickness, centre, radius):
    from netgen.occ import Glue, WorkPlane, Z

    plane = WorkPlane().MoveTo(*layout.outline_mm[0])
    for corner in layout.outline_mm[1:]:
        plane = plane.LineTo(*corner)
    x, y = layout.centres_mm[0]
    taxel = WorkPlane().Circle(x, y, layout.radius_mm).Face()
    ring = WorkPlane().Circle(x, y, layout.guard_radius_mm).Face() - taxel
    load = WorkPlane().Circle(*centre, radius).Face().Move((0, 0, thickness))
    solid = Glue([plane.Close().Face().Extrude(thickness * Z), taxel, ring, load])
    gap = np.pi * (layout.guard_radius_mm**2 - layout.radius_mm**2)
    for face in solid.faces:
        if face.center.z < 1e-6:
            face.name = (
                "gap"
                if np.isclose(face.mass, gap, rtol=1e-3)
                else ("taxel" if np.isclose(face.mass, np.pi * layout.radius_mm**2, rtol=1e-3) else "guard")
            )
            face.maxh = {"taxel": 0.5, "gap": 0.1, "guard": 1.0}[face.name]
        elif face.center.z > thickness - 1e-6:
            face.name = "load" if np.isclose(face.mass, np.pi * radius**2, rtol=1e-3) else "top"
        else:
            face.name = "side"
    return solid


def _deformation(ngsolve, mesh, poisson, young, pressure):
    """Displacement of linear elasticity, bonded to the floor."""
    space = ngsolve.VectorH1(mesh, order=2, dirichlet="taxel|guard|gap")
    u, v = space.TnT()
    mu, lam = young / 2 / (1 + poisson), young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    shear = ngsolve.InnerProduct(ngsolve.Sym(ngsolve.Grad(u)), ngsolve.Sym(ngsolve.Grad(v)))
    form = ngsolve.BilinearForm((2 * mu * shear + lam * ngsolve.div(u) * ngsolve.div(v)) * ngsolve.dx).Assemble()
    load = ngsolve.LinearForm(-pressure * v[2] * ngsolve.ds("load")).Assemble()
    moved = ngsolve.GridFunction(space)
    moved.vec.data = form.mat.Inverse(space.FreeDofs(), "sparsecholesky") * load.vec
    return moved
