"""Heat conduction in a casing ring by finite volumes, exact in time.

The ring is rotationally symmetric, so its cells are coupled around by circulant matrices: a discrete Fourier transform around
leaves one small symmetric eigenvalue problem for each harmonic, solved once. A step of any length H is then exact for heat that is
held and for gas and air temperatures that are linear in time. Heat stored and heat exchanged are integrals of the same modes.

It shares nothing with the finite elements of the thermal unit that ships. numpy only.
"""

from dataclasses import dataclass

import numpy


@dataclass(frozen=True)
class Casing:
    """A ring: by default casing37, around rotor 37, with the films of `tiprub thermal`. SI units.

    rings, radii: axial positions of the contact rings and inner radius there (m), shape (3,); in between a natural cubic spline,
    straight beyond. flanges: axial length and radial height over the shell of that at the low and at the high end (m).
    films: film coefficients inside and outside (W/(m² K)).
    """

    axial: tuple = (-0.038, 0.042)
    rings: tuple = (0.0026, 0.0203, 0.038)
    radii: tuple = (0.2533533217905055, 0.24848690340413115, 0.24365589418393868)
    thickness: float = 4e-3
    flanges: tuple = ((5e-3, 10e-3), (4e-3, 6e-3))
    conductivity: float = 53.3
    specific_heat: float = 439.8
    density: float = 7850.0
    films: tuple = (500.0, 25.0)
    patches: int = 12

    def radius(self, z):
        """Inner radius (m) at axial positions z (m)."""
        z = numpy.asarray(z, dtype=float)
        (first, _, last), r = self.rings, self.radii
        step = 0.5 * (last - first)
        before, after = r[1] - r[0], r[2] - r[1]
        bend = 1.5 * (after - before)
        place = (z - first) / step
        low = r[0] + place * (before - bend / 6.0)
        high = r[2] + (place - 2.0) * (after + bend / 6.0)
        near = numpy.where(place < 1.0, place, 2.0 - place)
        share = numpy.where(place < 1.0, place, place - 1.0)
        start, end = numpy.where(place < 1.0, r[0], r[1]), numpy.where(place < 1.0, r[1], r[2])
        inside = start + share * (end - start) + bend * (near**3 - near) / 6.0
        return numpy.where(place < 0.0, low, numpy.where(place > 2.0, high, inside))


def _edges(breaks, target):
    """Cell edges with all of `breaks` among them, about `target` apart."""
    edges = [breaks[0]]
    for low, high in zip(breaks, breaks[1:]):
        if high - low < 1e-9:
            continue
        count = max(1, round((high - low) / target))
        edges += list(low + (high - low) * numpy.arange(1, count + 1) / count)
    return numpy.array(edges)


class Grid:
    """Cells of one section, and what connects them. All sections around are alike.

    capacity: J/K of each cell, shape (cells,). section: conduction within a section (W/K), shape (cells, cells); rows sum to 0.
    around: conductance to the same cell of the next section, shape (cells,). films: conductance to gas and air, shape (2, cells).
    heated: share of the heat of a section that each cell takes, shape (cells,). layers: radial cells through the shell.
    """

    def __init__(self, casing, around=72, along=5e-3, layers=4):
        if around % casing.patches:
            raise ValueError(f"{around} sections around are no multiple of {casing.patches} patches: choose such a number")
        low, high = casing.axial
        (low_length, _), (high_length, _) = casing.flanges
        breaks = sorted({low, low + low_length, casing.rings[0], casing.rings[2], high - high_length, high})
        edges = _edges(breaks, along)
        self.around_count = around
        shell = casing.thickness * numpy.arange(layers + 1) / layers
        columns = []
        for z0, z1 in zip(edges, edges[1:]):
            middle, offsets = 0.5 * (z0 + z1), shell
            for (length, height), flanged in zip(casing.flanges, (middle < low + low_length, middle > high - high_length)):
                if flanged:
                    extra = max(1, round(height / (casing.thickness / layers) / 2))
                    offsets = numpy.concatenate([shell, casing.thickness + height * numpy.arange(1, extra + 1) / extra])
            columns.append(offsets)
        self._build(casing, edges, columns, 2.0 * numpy.pi / around)

    def _build(self, casing, edges, columns, angle):
        """Two-point fluxes between centres of cells; the contour's slope lengthens what runs along it."""
        k = casing.conductivity
        cells = [(row, layer) for row, offsets in enumerate(columns) for layer in range(len(offsets) - 1)]
        number = {cell: index for index, cell in enumerate(cells)}
        n = len(cells)
        self.section, self.films = numpy.zeros((n, n)), numpy.zeros((2, n))
        self.volume, self.around = numpy.zeros(n), numpy.zeros(n)
        self.heated, self.surface = numpy.zeros(n), numpy.zeros(n)
        for (row, layer), i in number.items():
            offsets, length = columns[row], edges[row + 1] - edges[row]
            middle = 0.5 * (edges[row] + edges[row + 1])
            inner, slope = self._wall(casing, edges[row], edges[row + 1])
            a, b = inner + offsets[layer], inner + offsets[layer + 1]
            mean, thick = 0.5 * (a + b), b - a
            self.volume[i] = angle * mean * thick * length
            self.around[i] = k * thick * length / (angle * mean)
            # Layers are as thick measured along r as the wall is; across it heat has a shorter way, over a longer face.
            stretch = 1.0 + slope**2
            if layer + 2 < len(offsets):
                other = number[row, layer + 1]
                centre = 0.5 * (offsets[layer + 2] - offsets[layer])
                self._join(i, other, k * angle * b * length * stretch / centre)
            above = (row + 1, layer)
            if above in number:
                j = number[above]
                gap = 0.5 * (edges[row + 2] - edges[row])
                radius = float(casing.radius(edges[row + 1])) + 0.5 * (offsets[layer] + offsets[layer + 1])
                self._join(i, j, k * angle * radius * thick / gap)
            face = lambda r, along: angle * r * along
            rise = numpy.sqrt(stretch)
            half = 0.5 * thick / rise
            if layer == 0:
                area = face(a, length * rise)
                self.films[0, i] = area / (1.0 / casing.films[0] + half / k) if casing.films[0] else 0.0
                self.surface[i] = area
                if casing.rings[0] < middle < casing.rings[2]:
                    self.heated[i] = area
            if layer + 2 == len(offsets):
                self._film_outside(i, face(b, length * rise), half, casing)
            for side, end in ((row - 1, 0), (row + 1, 1)):
                # The faces of flanges beside the shell are in the air; the ends of the ring let no heat through.
                if 0 <= side < len(columns) and (side, layer) not in number:
                    self._film_outside(i, angle * mean * thick, 0.5 * length, casing)
        self.heated /= self.heated.sum()
        self.capacity = casing.density * casing.specific_heat * self.volume

    @staticmethod
    def _wall(casing, z0, z1):
        ends = casing.radius([z0, z1])
        return float(casing.radius(0.5 * (z0 + z1))), float((ends[1] - ends[0]) / (z1 - z0))

    def _join(self, i, j, conductance):
        self.section[[i, j], [i, j]] += conductance
        self.section[[i, j], [j, i]] -= conductance

    def _film_outside(self, i, area, half, casing):
        if casing.films[1]:
            self.films[1, i] += area / (1.0 / casing.films[1] + half / casing.conductivity)


def _phis(x):
    """φ1, φ2, φ3 of −x: (1 − e^−x)/x, (1 − φ1)/x, (½ − φ2)/x, by their series where x is small."""
    series = [sum((-x) ** n / numpy.prod(numpy.arange(1.0, n + k + 1)) for n in range(12)) for k in (1, 2, 3)]
    safe = numpy.where(x > 0.3, x, 1.0)
    one = -numpy.expm1(-safe) / safe
    two = (1.0 - one) / safe
    three = (0.5 - two) / safe
    return [numpy.where(x > 0.3, exact, near) for exact, near in zip((one, two, three), series)]


class Conduction:
    """Temperatures of the casing, and its energy balance.

    temperature: K above the reference, shape (sections, cells). patch: mean over the volume of each patch, shape (patches,).
    stored, supplied, gas, ambient: J, stored now and received since the start from `step`'s heat, gas and air.
    """

    def __init__(self, casing=None, around=72, along=5e-3, layers=4):
        self.casing = casing or Casing()
        self.grid = grid = Grid(self.casing, around, along, layers)
        root = numpy.sqrt(grid.capacity)
        harmonics = numpy.arange(around // 2 + 1)
        base = grid.section + numpy.diag(grid.films.sum(axis=0))
        turn = 2.0 - 2.0 * numpy.cos(2.0 * numpy.pi * harmonics / around)
        pencils = (base + turn[:, None, None] * numpy.diag(grid.around)) / root / root[:, None]
        rates, shapes = numpy.linalg.eigh(pencils)
        self._rates = numpy.maximum(rates, 0.0)
        self._to_modes = shapes.transpose(0, 2, 1) / root  # of loads (W)
        self._to_cells = shapes / root[:, None]  # of amplitudes, to temperatures
        self._gas, self._air = (around * self._to_modes[0] @ film for film in grid.films)
        self._per_patch = around // self.casing.patches
        self._cache = {}
        self.amplitudes = numpy.zeros(self._rates.shape, dtype=complex)
        self.sides = numpy.zeros(2)  # gas and air temperature reached (K)
        self.supplied = self.gas = self.ambient = 0.0

    def _coefficients(self, step):
        if step not in self._cache:
            if len(self._cache) > 64:
                self._cache.clear()
            self._cache[step] = (numpy.exp(-self._rates * step), *_phis(self._rates * step))
        return self._cache[step]

    def step(self, step, heat, sides=(0.0, 0.0), slope=None):
        """Advance by `step` (s): `heat` (W, shape (patches,)) at its start with `slope` (W/s), gas and air ramped to `sides` (K)."""
        decay, one, two, three = self._coefficients(step)
        heat = numpy.asarray(heat, dtype=float)
        slope = numpy.zeros_like(heat) if slope is None else numpy.asarray(slope, dtype=float)
        held, rising = self._load(heat), self._load(slope)
        rate = (numpy.asarray(sides, dtype=float) - self.sides) / step
        for film, now, change in ((self._gas, self.sides[0], rate[0]), (self._air, self.sides[1], rate[1])):
            held[0] += film * now
            rising[0] += film * change
        before = self.amplitudes
        self.amplitudes = decay * before + step * one * held + step**2 * two * rising
        # Of the mean around, what the temperatures are integrated over the step: all that gas and air see.
        mean = (step * one * before + step**2 * two * held + step**3 * three * rising)[0].real
        films = [self._to_modes[0] @ film for film in self.grid.films]
        received = [
            film.sum() * self.grid.around_count * step * (now + 0.5 * step * change) - modal @ mean
            for film, modal, now, change in zip(self.grid.films, films, self.sides, rate)
        ]
        self.gas += received[0]
        self.ambient += received[1]
        self.supplied += step * float(heat.sum() + 0.5 * step * slope.sum())
        self.sides = numpy.array(sides, dtype=float)

    def _load(self, heat):
        """Modal loads of heat by patch (W)."""
        sections = numpy.repeat(heat, self._per_patch) / self._per_patch
        return numpy.fft.rfft(sections)[:, None] * (self._to_modes @ self.grid.heated)

    @property
    def temperature(self):
        spectrum = numpy.einsum("hcm,hm->hc", self._to_cells, self.amplitudes)
        return numpy.fft.irfft(spectrum, n=self.grid.around_count, axis=0)

    @property
    def patch(self):
        weights = self.grid.volume / self.grid.volume.sum()
        sections = self.temperature @ weights
        return sections.reshape(self.casing.patches, self._per_patch).mean(axis=1)

    @property
    def stored(self):
        return float((self.temperature @ self.grid.capacity).sum())

    @property
    def capacity(self):
        """J/K of the whole casing."""
        return float(self.grid.capacity.sum() * self.grid.around_count)

    @property
    def residual(self):
        """J: stored less received, rounding only; it starts at the reference temperature."""
        return self.stored - (self.supplied + self.gas + self.ambient)
