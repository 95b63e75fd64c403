"""VTK's two volume ray casters, drawing what voxloom draws: same voxels, transfer function, camera.

Pictures are arrays [y, x, rgb], row 0 on top, 0 to 1; VTK delivers them in 8 bits. Nothing is tone
mapped. Needs Debian's python3-vtk9, numpy, and Xvfb where there is no display.
"""

import os
import statistics
import subprocess
import time

import numpy as np


def start_display():
    """Gives VTK a display: the one that is there, or an Xvfb that the system ends after this program
    (ending it any sooner would take the display from under VTK)."""
    if os.environ.get("DISPLAY"):
        return
    reader, writer = os.pipe()
    subprocess.Popen(
        ["setpriv", "--pdeathsig", "TERM", "Xvfb", "-displayfd", str(writer), "-noreset",
         "-screen", "0", "1280x1280x24", "-nolisten", "tcp"],
        pass_fds=[writer], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    os.close(writer)
    with os.fdopen(reader) as answer:
        number = answer.readline().strip()
    if not number:
        raise RuntimeError("Xvfb did not start; install the package xvfb")
    os.environ["DISPLAY"] = ":" + number


def import_vtk():
    """The VTK modules that are needed, or ImportError."""
    from vtkmodules import vtkCommonCore, vtkCommonDataModel, vtkCommonMath, vtkRenderingCore
    from vtkmodules import vtkRenderingVolume, vtkRenderingVolumeOpenGL2
    from vtkmodules.util import numpy_support
    import vtkmodules.vtkRenderingOpenGL2  # noqa: F401  the back end behind vtkRenderingCore
    return {name: getattr(module, name)
            for module in (vtkCommonCore, vtkCommonDataModel, vtkCommonMath, vtkRenderingCore,
                           vtkRenderingVolume, vtkRenderingVolumeOpenGL2)
            for name in dir(module) if name.startswith("vtk")} | {"numpy_support": numpy_support}


class TransferTable:
    """A 1-D transfer function given by points [value, tau, tau*r, tau*g, tau*b], sampled densely.

    voxloom is linear in tau and tau*c between points, VTK in opacity and c: only dense samples say
    the same in both. Where nothing is absorbed a colour cannot be seen, and VTK would still blend
    towards it: the nearest visible colour stands there.
    """

    def __init__(self, points, reference_length, value_range, samples=8192):
        points = np.asarray(points, float)
        self.reference_length = reference_length
        self.range = value_range if value_range[1] > value_range[0] else (value_range[0], value_range[0] + 1)
        values = np.linspace(*self.range, samples)
        emission = np.stack([self._at(points, values, c) for c in range(1, 5)], axis=1)
        tau = emission[:, 0]
        self.opacity = -np.expm1(-tau * reference_length)
        self.colour = np.ones((samples, 3))
        visible = np.flatnonzero(tau > 0)
        if len(visible):
            halfway = 0.5 * (values[visible[1:]] + values[visible[:-1]])
            nearest = visible[np.searchsorted(halfway, values)]
            self.colour = emission[nearest, 1:] / tau[nearest, None]

    @staticmethod
    def _at(points, values, column):
        """Linear between points; of several points with one value the last holds from there on."""
        knots = points[:, 0]
        after = np.searchsorted(knots, values, side="right").clip(0, len(knots))
        left, right = (after - 1).clip(0), after.clip(0, len(knots) - 1)
        width = knots[right] - knots[left]
        share = np.divide(values - knots[left], width, out=np.zeros_like(values), where=width > 0)
        return points[left, column] + share * (points[right, column] - points[left, column])


class RayCaster:
    """A window with one volume in it, drawn by VTK's GPU or CPU ray caster."""

    def __init__(self, vtk, kind, voxels, index_to_world, table, camera, size, light=None):
        """kind: 'gpu' or 'cpu'; index_to_world: 12 numbers, row by row; light: None for no shading,
        else ambient, diffuse, specular and shininess of one headlight."""
        self.vtk = vtk
        self.size = size
        matrix = np.reshape(index_to_world, (3, 4))
        spacing = np.linalg.norm(matrix[:, :3], axis=0)
        self.voxel = float(spacing.min())

        self.scalars = np.ascontiguousarray(voxels).ravel()
        image = vtk["vtkImageData"]()
        image.SetDimensions(*voxels.shape[::-1])
        image.SetSpacing(*spacing)
        image.GetPointData().SetScalars(vtk["numpy_support"].numpy_to_vtk(self.scalars))
        self.image = image

        if kind == "gpu":
            mapper = vtk["vtkOpenGLGPUVolumeRayCastMapper"]()
            mapper.SetUseJittering(0)
        else:
            mapper = vtk["vtkFixedPointVolumeRayCastMapper"]()
            mapper.SetImageSampleDistance(1)
            mapper.SetMinimumImageSampleDistance(1)
        mapper.SetInputData(image)
        mapper.SetAutoAdjustSampleDistances(0)
        mapper.SetBlendModeToComposite()
        self.mapper = mapper

        volume = vtk["vtkVolume"]()
        volume.SetMapper(mapper)
        volume.SetProperty(self._property(table, light))
        placed = vtk["vtkMatrix4x4"]()
        for row in range(3):
            for column in range(3):
                placed.SetElement(row, column, matrix[row, column] / spacing[column])
            placed.SetElement(row, 3, matrix[row, 3])
        volume.SetUserMatrix(placed)

        self.renderer = vtk["vtkRenderer"]()
        self.renderer.SetBackground(0, 0, 0)
        self.renderer.AddVolume(volume)
        view = self.renderer.GetActiveCamera()
        view.SetPosition(*camera["eye"])
        view.SetFocalPoint(*camera["target"])
        view.SetViewUp(*camera["up"])
        view.SetParallelProjection(0 if camera["perspective"] else 1)
        view.SetViewAngle(np.degrees(camera["vertical_fov"]))
        view.SetParallelScale(camera["height"] / 2)
        self.window = vtk["vtkRenderWindow"]()
        self.window.SetOffScreenRendering(1)
        self.window.SetMultiSamples(0)
        self.window.SetSize(*size)
        self.window.AddRenderer(self.renderer)
        self.renderer.ResetCameraClippingRange()

    def _property(self, table, light):
        vtk = self.vtk
        opacity = vtk["vtkPiecewiseFunction"]()
        colour = vtk["vtkColorTransferFunction"]()
        samples = len(table.opacity)
        opacity.BuildFunctionFromTable(*table.range, samples, table.opacity)
        colour.BuildFunctionFromTable(*table.range, samples, table.colour.ravel())
        properties = vtk["vtkVolumeProperty"]()
        properties.SetScalarOpacity(opacity)
        properties.SetColor(colour)
        properties.SetScalarOpacityUnitDistance(table.reference_length)
        properties.SetInterpolationTypeToLinear()
        properties.SetShade(light is not None)
        if light:
            properties.SetAmbient(light["ambient"])
            properties.SetDiffuse(light["diffuse"])
            properties.SetSpecular(light["specular"])
            properties.SetSpecularPower(light["shininess"])
        return properties

    def draw(self, step, repeat=1, warm_up=1, clock=time.perf_counter):
        """Samples every `step` voxels; the picture and the median of the seconds it took by `clock`."""
        self.mapper.SetSampleDistance(step * self.voxel)
        if hasattr(self.mapper, "SetInteractiveSampleDistance"):
            self.mapper.SetInteractiveSampleDistance(step * self.voxel)
        seconds = []
        for k in range(warm_up + repeat):
            self.renderer.GetActiveCamera().Azimuth(1e-9)  # nothing is kept from the last picture
            self.window.WaitForCompletion()
            start = clock()
            self.window.Render()
            self.window.WaitForCompletion()
            if k >= warm_up:
                seconds.append(clock() - start)
        return self._read_back(), statistics.median(seconds)

    def _read_back(self):
        pixels = self.vtk["vtkUnsignedCharArray"]()
        width, height = self.size
        self.window.GetRGBACharPixelData(0, 0, width - 1, height - 1, 0, pixels)
        array = self.vtk["numpy_support"].vtk_to_numpy(pixels).reshape(height, width, 4)
        return array[::-1, :, :3].astype(float) / 255

    def close(self):
        self.window.Finalize()
