"""Style of all pictures of the gallery, and off-screen views of VTK files."""

import matplotlib
import numpy
import pyvista
from matplotlib import pyplot

pyplot.switch_backend("Agg")
# Silences the warning of VTK that there is no screen.
pyvista.vtk_verbosity("off")

BLUE, ORANGE, GREEN, GREY, DARK = "#1f6fb2", "#d9601a", "#2c8c4b", "#9aa1a9", "#23272b"
# Colour maps: one for forces and amplitudes, from white to dark, and one for displacements on bodies, on which shades stay visible.
LEVELS, SIZES = "magma_r", matplotlib.colors.LinearSegmentedColormap.from_list("sizes", ["#e9e4d8", "#f2b04a", "#d9501a", "#7a1630"])
WIDTH, HEIGHT, RESOLUTION = 6.0, 3.1, 150

pyplot.rcParams.update(
    {
        "font.size": 10.5,
        "axes.titlesize": 11,
        "axes.titlelocation": "left",
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.edgecolor": DARK,
        "axes.grid": True,
        "grid.alpha": 0.25,
        "legend.frameon": False,
        "legend.fontsize": 9.5,
        "legend.handlelength": 1.4,
        "lines.linewidth": 1.5,
        "image.cmap": LEVELS,
    }
)


def panels(*widths, height=HEIGHT):
    """Return a figure and its axes, which are side by side with the width ratios `widths`."""
    figure, axes = pyplot.subplots(1, len(widths), figsize=(WIDTH, height), width_ratios=widths, layout="constrained", squeeze=False)
    figure.get_layout_engine().set(w_pad=0.08)
    return figure, *axes[0]


def bar(figure, image, axis, label):
    """Draw a colour bar beside an axis."""
    colours = figure.colorbar(image, ax=axis, pad=0.02, aspect=25, label=label)
    colours.outline.set_visible(False)


def scale(figure, axis, limits, label):
    """Draw a colour bar below a 3-D view, for the displacements."""
    image = matplotlib.cm.ScalarMappable(matplotlib.colors.Normalize(*limits), SIZES)
    colours = figure.colorbar(image, cax=axis.inset_axes([0.12, -0.04, 0.76, 0.04]), orientation="horizontal", label=label)
    colours.outline.set_visible(False)


def view(axis, parts, direction, zoom=1.0):
    """Draw bodies in 3-D, pairs of a pyvista mesh and options of `add_mesh`, seen from a direction."""
    plotter = pyvista.Plotter(off_screen=True, window_size=(900, 900))
    plotter.enable_anti_aliasing("ssaa")
    for mesh, options in parts:
        plotter.add_mesh(mesh, **{"show_scalar_bar": False, "cmap": SIZES, **options})
    plotter.view_vector(direction)
    plotter.camera.zoom(zoom)
    pixels = plotter.screenshot(return_img=True)
    plotter.close()
    drawn = numpy.argwhere((pixels < 250).any(axis=2))
    (top, left), (bottom, right) = drawn.min(axis=0), drawn.max(axis=0)
    axis.imshow(pixels[top : bottom + 1, left : right + 1], interpolation="antialiased")
    axis.set_axis_off()


def save(figure, file):
    figure.savefig(file, dpi=RESOLUTION, pil_kwargs={"optimize": True})
    pyplot.close(figure)
