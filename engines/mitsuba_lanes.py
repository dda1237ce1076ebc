"""Painting a window with a compiled variant of Mitsuba: one kernel for all windows of a scene.

What `mitsuba.render` bakes into its kernels (place and size of the window, number of samples) is data here. Film and
sensor keep the whole frame, so that a place on the film means the same in each window. The sums over the samples of a
pixel are block reductions and no atomic additions: equal requests give equal bits, whatever the threads do.
"""

import drjit as dr
import mitsuba as mi

from line_protocol import Window
from planes import Sums, of_array


def paint_in_lanes(scene, integrator, order, lanes, progress):
    """-> (channels: name -> float32 `[height, width]` of the window, samples taken)."""
    painter = _Painter(scene, integrator, order)
    strips = painter.strips(lanes)
    for index, (y0, y1, samples) in enumerate(strips):
        painter.add(y0, y1, samples, order.hashed_seed(31, index, *order.window.as_list()))
        progress((index + 1) / len(strips))
    return painter.channels(), painter.taken()


class _Painter:
    def __init__(self, scene, integrator, order):
        self.scene, self.integrator, self.order = scene, integrator, order
        self.sampler = scene.sensor.sampler().clone()
        window, margin = order.window, scene.margin
        # Pixels whose samples reach into the window. Where the film samples its border, there are some outside the frame.
        border = margin if scene.film.sample_border() else 0
        self.wide = Window(max(window.x0 - margin, -border), max(window.y0 - margin, -border),
                           min(window.x1 + margin, scene.width + border),
                           min(window.y1 + margin, scene.height + border))
        self.names = ["R", "G", "B"] + (["A"] if scene.with_alpha else [])
        self.names += [name for name in scene.layer_channels.values() if name]
        # The last plane is the filter's weights.
        self.weights = len(self.names)
        self.sums = Sums(self.weights + 1, self.wide.height, self.wide.width)
        self.samples_of_row = [0] * self.wide.height

    def strips(self, lanes):
        """Cuts the work into rows, all samples of a pixel together as far as `lanes` allow: (y0, y1, samples) each."""
        wide, samples = self.wide, self.order.samples
        rows = max(1, lanes // (wide.width * samples))
        most = max(1, lanes // wide.width)
        return [(y, min(y + rows, wide.height), min(most, samples - done))
                for y in range(0, wide.height, rows) for done in range(0, samples, most)]

    def add(self, y0, y1, samples, seed):
        """Takes samples of the rows y0 <= y < y1 of the wide window."""
        width, height = self.wide.width, y1 - y0
        self.sampler.set_sample_count(samples)
        samples = int(self.sampler.sample_count())
        count = width * height * samples
        if count >= 1 << 32:
            raise MemoryError(f"{count} samples at once are more than Mitsuba can take")
        self.sampler.set_samples_per_wavefront(samples)
        self.sampler.seed(dr.opaque(mi.UInt32, seed), count)
        pixel = dr.arange(mi.UInt32, count) // dr.opaque(mi.UInt32, samples)
        wide_width = dr.opaque(mi.UInt32, width)
        row = pixel // wide_width
        inside = self.sampler.next_2d()
        left = self.wide.x0 + self.scene.offset[0]
        top = self.wide.y0 + y0 + self.scene.offset[1]
        place = mi.Point2f(mi.Float(pixel - row * wide_width) + dr.opaque(mi.Float, left) + inside.x,
                           mi.Float(row) + dr.opaque(mi.Float, top) + inside.y)
        values = self._follow(place, samples)
        self._collect(values, inside, y0, height, samples)
        for y in range(y0, y1):
            self.samples_of_row[y] += samples

    def _follow(self, place, samples):
        """What the integrator sees through places on the film: the values of all channels."""
        sensor, sampler = self.scene.sensor, self.sampler
        aperture = sampler.next_2d() if sensor.needs_aperture_sample() else mi.Point2f(0.5)
        time = mi.Float(sensor.shutter_open())
        if sensor.shutter_open_time() > 0:
            time += sampler.next_1d() * sensor.shutter_open_time()
        wavelength = sampler.next_1d() if mi.is_spectral else mi.Float(0.0)
        size = self.scene.film_crop
        relative = mi.Point2f((place.x - size[0]) / size[2], (place.y - size[1]) / size[3])
        ray, weight = sensor.sample_ray_differential(time, wavelength, relative, aperture)
        if ray.has_differentials:
            ray.scale_differential(dr.opaque(mi.Float, samples ** -0.5))
        light, valid, layers = self.integrator.sample(self.scene.scene, sampler, ray, sensor.get_medium())
        light = light * weight
        if mi.is_spectral:
            color = mi.spectrum_to_srgb(light, ray.wavelengths)
        elif mi.is_monochromatic:
            color = mi.Color3f(light[0])
        else:
            color = light
        values = [color[0], color[1], color[2]]
        if self.scene.with_alpha:
            values.append(dr.select(valid, mi.Float(1.0), mi.Float(0.0)))
        for layer, name, is_number in zip(layers, self.scene.layer_channels.values(), self.scene.numbers_shapes):
            if name is not None:
                values.append(self.scene.numbered(layer) if is_number else layer)
        return values

    def _collect(self, values, inside, y0, height, samples):
        """Adds each sample to all pixels that the filter lets it reach."""
        reach = self.scene.margin
        if reach == 0:
            sums = [dr.block_reduce(dr.ReduceOp.Add, value, samples) for value in values]
            dr.eval(*sums)
            for plane, part in enumerate(sums):
                self.sums.add(plane, of_array(part), height, y0)
            self.sums.add_number(self.weights, y0, y0 + height, samples)
            return
        dr.eval(inside, *values)
        for dy in range(-reach, reach + 1):
            weight_y = self.scene.filter.eval(inside.y - 0.5 - dy)
            for dx in range(-reach, reach + 1):
                weight = self.scene.filter.eval(inside.x - 0.5 - dx) * weight_y
                sums = [dr.block_reduce(dr.ReduceOp.Add, value * weight, samples) for value in values]
                sums.append(dr.block_reduce(dr.ReduceOp.Add, weight, samples))
                dr.eval(*sums)
                for plane, part in enumerate(sums):
                    self.sums.add(plane, of_array(part), height, y0 + dy, dx)

    def channels(self):
        window, wide = self.order.window, self.wide
        place = (window.x0 - wide.x0, window.y0 - wide.y0, window.x1 - wide.x0, window.y1 - wide.y0)
        return {name: self.sums.means(plane, *place, weights=self.weights) for plane, name in enumerate(self.names)}

    def taken(self):
        """Samples of each pixel. Some samplers take more than asked for."""
        return min(self.samples_of_row)
