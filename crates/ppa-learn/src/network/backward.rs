//! The backward pass: the gradient of every parameter from that of the features.
//!
//! With a batch normalisation the gradient of a pixel needs sums over all pixels first. Each pass over the pixels
//! therefore applies what the previous one summed, and sums for the next.

use rayon::prelude::*;

use super::architecture::{Architecture, Block};
use super::forward::{gated, total};
use super::tape::{BlockTape, Normed, Size, Tape, by_image, tile_pixels};
use crate::kernels::buffer::{Buffer, Pool};
use crate::kernels::depthwise::{Rows, channels_first, channels_last};
use crate::kernels::depthwise_backward::{InputRow, add_weight_gradient};
use crate::kernels::gradient::{
    ActivationGradient, ActivationSums, Linear, activate_with_derivative, add_gradient_sums,
    combine,
};
use crate::kernels::matrix::{Matrix, Store, multiply};
use crate::kernels::stem;

/// What a backward pass reads, and the gradients that it writes, laid out as the parameters.
pub struct Backward<'a> {
    pub architecture: &'a Architecture,
    pub parameters: &'a [f32],
    pub gradients: &'a mut [f32],
    pub pool: &'a Pool,
}

impl Backward<'_> {
    /// Writes all gradients, from that of the features [images, 1280].
    pub fn run(mut self, tape: Tape, of_features: &[f32]) {
        let Tape {
            image_size,
            blocks,
            head_input,
            head_size,
            head,
        } = tape;
        let mut gradient = self.head(&head_input, &head, head_size, of_features);
        drop((head_input, head));
        for (index, (block, tape)) in self
            .architecture
            .blocks
            .iter()
            .zip(blocks)
            .enumerate()
            .rev()
        {
            let (linear, of_output) = self.project(block, &tape, &gradient);
            let (linear, of_expanded) = self.depthwise(block, &tape, linear, of_output);
            if index == 0 {
                self.stem(block, &tape, image_size, &linear, &of_expanded);
            } else {
                self.expand(block, &tape, &linear, &of_expanded, &mut gradient);
            }
        }
    }

    /// The gradient of the last block's output.
    fn head(&mut self, input: &[f32], head: &Normed, size: Size, of_features: &[f32]) -> Buffer {
        let place = &self.architecture.head;
        let (channels, per_image) = (place.channels, size.pixels() * place.channels);
        let pooled: Vec<f32> = of_features
            .iter()
            .map(|g| g / size.pixels() as f32)
            .collect();
        let images = head
            .pixels
            .par_chunks(per_image)
            .zip(pooled.par_chunks(channels));
        let sums = total(images.map(|(pixels, pooled)| {
            let mut sums = ActivationSums::zeros(channels);
            for part in pixels.chunks(256 * channels) {
                sums.add(None, part, &head.norm.affine, &head.norm.mean);
            }
            scaled(&sums.derivative, pooled)
        }));
        let linear = head
            .norm
            .backward(&place.norm, &sums, size.count(), self.gradients);

        let weight = &self.parameters[place.weight.clone()];
        let columns = weight.len() / channels;
        let mut of_input = self.pool.take(size.count() * columns);
        let task = size.pixels_per_task();
        let parts = of_input.par_chunks_mut(task * columns).enumerate();
        let of_weight = total(parts.map(|(index, of_input)| {
            let mut sums = vec![0.0; weight.len()];
            let tile = tile_pixels(2 * channels + columns);
            let mut of_pixels = self.pool.take(tile * channels);
            for (number, of_input) in of_input.chunks_mut(tile * columns).enumerate() {
                let start = index * task + number * tile;
                let run = start..start + of_input.len() / columns;
                let of_pixels = &mut of_pixels[..run.len() * channels];
                for (image, part) in by_image(run.clone(), size) {
                    let pixels =
                        (run.start + part.start) * channels..(run.start + part.end) * channels;
                    ActivationGradient {
                        upstream: None,
                        pixels: &head.pixels[pixels],
                        affine: &head.norm.affine,
                        linear: &linear,
                        gate: &pooled[image * channels..][..channels],
                        pooled: &pooled[image * channels..][..channels],
                        out: &mut of_pixels[part.start * channels..part.end * channels],
                    }
                    .run();
                }
                let input = &input[run.start * columns..run.end * columns];
                multiply(
                    &mut sums,
                    Matrix::new(of_pixels, channels).transposed(),
                    Matrix::new(input, columns),
                    Store::Add,
                );
                multiply(
                    of_input,
                    Matrix::new(of_pixels, channels),
                    Matrix::new(weight, columns),
                    Store::Replace,
                );
            }
            sums
        }));
        self.gradients[place.weight.clone()].copy_from_slice(&of_weight);
        of_input
    }

    /// Through residual, projection and squeeze-and-excitation: the gradient of the gated activation, and how that of
    /// the depthwise convolution follows from it.
    fn project(&mut self, block: &Block, tape: &BlockTape, of_output: &[f32]) -> (Gated, Buffer) {
        let (place, size) = (&block.project, tape.size_out);
        let (project, depthwise) = (&tape.project, &tape.depthwise);
        let (channels, columns) = (place.channels, block.depthwise.channels);
        let per_image = size.pixels() * channels;
        let images = project
            .pixels
            .par_chunks(per_image)
            .zip(of_output.par_chunks(per_image))
            .zip(&tape.gains);
        let sums = total(images.map(|((pixels, gradient), gain)| {
            let mut sums = vec![0.0; 2 * channels];
            let tile = 256 * channels;
            for (pixels, gradient) in pixels.chunks(tile).zip(gradient.chunks(tile)) {
                add_gradient_sums(gradient, pixels, &project.norm.mean, *gain, &mut sums);
            }
            sums
        }));
        let linear = project
            .norm
            .backward(&place.norm, &sums, size.count(), self.gradients);

        let weight = &self.parameters[place.weight.clone()];
        let mut of_gated = self.pool.take(size.count() * columns);
        let task = size.pixels_per_task();
        let parts: Vec<(Vec<f32>, Vec<ActivationSums>)> = of_gated
            .par_chunks_mut(task * columns)
            .enumerate()
            .map(|(index, of_gated)| {
                let mut of_weight = vec![0.0; weight.len()];
                let mut sums = vec![
                    ActivationSums::zeros(columns);
                    of_gated.len() / (size.pixels() * columns)
                ];
                let tile = tile_pixels(2 * channels + 3 * columns);
                let mut active = self.pool.take(tile * columns);
                let mut of_pixels = self.pool.take(tile * channels);
                for (number, of_gated) in of_gated.chunks_mut(tile * columns).enumerate() {
                    let start = index * task + number * tile;
                    let run = start..start + of_gated.len() / columns;
                    let active = &mut active[..run.len() * columns];
                    let of_pixels = &mut of_pixels[..run.len() * channels];
                    gated(
                        &depthwise.pixels,
                        &depthwise.norm.affine,
                        &tape.squeeze.gate,
                        size,
                        run.clone(),
                        active,
                    );
                    for (image, part) in by_image(run.clone(), size) {
                        let whole =
                            (run.start + part.start) * channels..(run.start + part.end) * channels;
                        let out = &mut of_pixels[part.start * channels..part.end * channels];
                        combine(
                            &of_output[whole.clone()],
                            &project.pixels[whole],
                            &linear,
                            tape.gains[image],
                            out,
                        );
                    }
                    let left = Matrix::new(of_pixels, channels);
                    multiply(
                        &mut of_weight,
                        left.transposed(),
                        Matrix::new(active, columns),
                        Store::Add,
                    );
                    multiply(of_gated, left, Matrix::new(weight, columns), Store::Replace);
                    for (image, part) in by_image(run.clone(), size) {
                        let pixels = &depthwise.pixels
                            [(run.start + part.start) * columns..(run.start + part.end) * columns];
                        let upstream = &of_gated[part.start * columns..part.end * columns];
                        let sums = &mut sums[image - index * size.images_per_task()];
                        sums.add(
                            Some(upstream),
                            pixels,
                            &depthwise.norm.affine,
                            &depthwise.norm.mean,
                        );
                    }
                }
                (of_weight, sums)
            })
            .collect();
        let (of_weight, sums): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
        let of_weight = total(of_weight.into_par_iter());
        self.gradients[place.weight.clone()].copy_from_slice(&of_weight);
        let sums: Vec<ActivationSums> = sums.into_iter().flatten().collect();

        let of_gate: Vec<f32> = sums
            .iter()
            .flat_map(|sums| &sums.gate)
            .map(|&sum| sum as f32)
            .collect();
        let mut pooled =
            tape.squeeze
                .backward(&block.squeeze, self.parameters, &of_gate, self.gradients);
        pooled.iter_mut().for_each(|g| *g /= size.pixels() as f32);
        let mut of_norm = vec![0.0; 2 * columns];
        for (image, sums) in sums.iter().enumerate() {
            let here = image * columns..(image + 1) * columns;
            let upstream = scaled(&sums.upstream, &tape.squeeze.gate[here.clone()]);
            for ((sum, a), b) in of_norm
                .iter_mut()
                .zip(upstream)
                .zip(scaled(&sums.derivative, &pooled[here]))
            {
                *sum += a + b;
            }
        }
        let linear = depthwise.norm.backward(
            &block.depthwise.norm,
            &of_norm,
            size.count(),
            self.gradients,
        );
        (Gated { linear, pooled }, of_gated)
    }

    /// Through the depthwise convolution: the gradient of the expansion's activation input, and how that of the
    /// expansion follows from it.
    fn depthwise(
        &mut self,
        block: &Block,
        tape: &BlockTape,
        gated: Gated,
        of_gated: Buffer,
    ) -> (Linear, Buffer) {
        let (place, window) = (&block.depthwise, block.window);
        let channels = place.channels;
        let weights = channels_last(&self.parameters[place.weight.clone()], channels);
        let (size, size_out) = (tape.size_in, tape.size_out);
        let (expand, depthwise) = (&tape.expand, &tape.depthwise);
        let (row, row_out) = (size.width * channels, size_out.width * channels);
        let (kernel, stride, padding) = (window.kernel, window.stride, window.padding());
        let mut of_expanded = self.pool.take(size.count() * channels);
        let parts: Vec<(Vec<f32>, Vec<f64>)> = of_expanded
            .par_chunks_mut(size.images_per_task() * size.height * row)
            .enumerate()
            .map(|(task, of_expanded)| {
                let mut of_weights = vec![0.0; weights.len()];
                let mut sums = vec![0.0; 2 * channels];
                // Rows of the input live until their gradient is known, a stride after the kernel has passed.
                let count = kernel + stride;
                let mut memory: [Buffer; 3] = [
                    self.pool
                        .take(Rows::len(count, size.width, padding, channels)),
                    self.pool.take(Rows::len(count, size.width, 0, channels)),
                    self.pool
                        .take(Rows::len(kernel, size_out.width, padding, channels)),
                ];
                for (index, of_expanded) in of_expanded.chunks_mut(size.height * row).enumerate() {
                    let image = task * size.images_per_task() + index;
                    let [first, second, third] = &mut memory;
                    let mut active =
                        Rows::new(first, count, size.height, size.width, padding, channels);
                    let mut derivative =
                        Rows::new(second, count, size.height, size.width, 0, channels);
                    let mut gradient = Rows::new(
                        third,
                        kernel,
                        size_out.height,
                        size_out.width,
                        padding,
                        channels,
                    );
                    let pixels = &expand.pixels[image * size.height * row..][..size.height * row];
                    let (mut next_active, mut next_done) = (0, 0);
                    for y in 0..size_out.height {
                        let top = (y * stride) as isize - padding as isize;
                        while next_active < size.height
                            && (next_active as isize) < top + kernel as isize
                        {
                            let pixels = &pixels[next_active * row..][..row];
                            activate_with_derivative(
                                pixels,
                                &expand.norm.affine,
                                active.place(next_active),
                                derivative.place(next_active),
                            );
                            next_active += 1;
                        }
                        let at = (image * size_out.height + y) * row_out;
                        ActivationGradient {
                            upstream: Some(&of_gated[at..at + row_out]),
                            pixels: &depthwise.pixels[at..at + row_out],
                            affine: &depthwise.norm.affine,
                            linear: &gated.linear,
                            gate: &tape.squeeze.gate[image * channels..][..channels],
                            pooled: &gated.pooled[image * channels..][..channels],
                            out: gradient.place(y),
                        }
                        .run();
                        let under: Vec<&[f32]> = (0..kernel)
                            .map(|ky| active.padded(top + ky as isize))
                            .collect();
                        add_weight_gradient(
                            window,
                            &under,
                            gradient.inner(y),
                            channels,
                            &mut of_weights,
                        );
                        // Input row r takes from output rows up to (r + padding) / stride.
                        let done = if y + 1 == size_out.height {
                            size.height
                        } else {
                            ((y + 1) * stride).saturating_sub(padding)
                        };
                        while next_done < done {
                            let from = rows_from(next_done, kernel, stride, padding, &gradient);
                            let mut part = vec![0.0; 2 * channels];
                            InputRow {
                                rows: &from,
                                weights: &weights,
                                derivative: derivative.inner(next_done),
                                pixels: &pixels[next_done * row..][..row],
                                mean: &expand.norm.mean,
                                out: &mut of_expanded[next_done * row..][..row],
                                sums: &mut part,
                            }
                            .run(window);
                            crate::kernels::batch_norm::add(&mut sums, &part);
                            next_done += 1;
                        }
                    }
                }
                (of_weights, sums)
            })
            .collect();
        let (of_weights, sums): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
        let of_weights = total(of_weights.into_par_iter());
        self.gradients[place.weight.clone()]
            .copy_from_slice(&channels_first(&of_weights, channels));
        let sums = total(sums.into_par_iter());
        let linear = expand
            .norm
            .backward(&block.expand.norm, &sums, size.count(), self.gradients);
        (linear, of_expanded)
    }

    /// Through the expansion: `gradient`, which is that of the block's output, becomes that of its input.
    fn expand(
        &mut self,
        block: &Block,
        tape: &BlockTape,
        linear: &Linear,
        of_expanded: &[f32],
        gradient: &mut Buffer,
    ) {
        let (place, size) = (&block.expand, tape.size_in);
        let (channels, columns) = (place.channels, block.channels_in);
        let weight = &self.parameters[place.weight.clone()];
        // With a residual the input's gradient is the output's and what the branch adds.
        let store = if block.residual {
            Store::Add
        } else {
            Store::Replace
        };
        if !block.residual {
            *gradient = self.pool.take(size.count() * columns);
        }
        let task = size.pixels_per_task();
        let parts = gradient.par_chunks_mut(task * columns).enumerate();
        let of_weight = total(parts.map(|(index, of_input)| {
            let mut sums = vec![0.0; weight.len()];
            let tile = tile_pixels(3 * channels + 2 * columns);
            let mut of_pixels = self.pool.take(tile * channels);
            for (number, of_input) in of_input.chunks_mut(tile * columns).enumerate() {
                let start = index * task + number * tile;
                let run = start..start + of_input.len() / columns;
                let of_pixels = &mut of_pixels[..run.len() * channels];
                let whole = run.start * channels..run.end * channels;
                combine(
                    &of_expanded[whole.clone()],
                    &tape.expand.pixels[whole],
                    linear,
                    1.0,
                    of_pixels,
                );
                let input = &tape.input[run.start * columns..run.end * columns];
                let left = Matrix::new(of_pixels, channels);
                multiply(
                    &mut sums,
                    left.transposed(),
                    Matrix::new(input, columns),
                    Store::Add,
                );
                multiply(of_input, left, Matrix::new(weight, columns), store);
            }
            sums
        }));
        self.gradients[place.weight.clone()].copy_from_slice(&of_weight);
    }

    /// The gradient of the first convolution's weights.
    fn stem(
        &mut self,
        block: &Block,
        tape: &BlockTape,
        image_size: Size,
        linear: &Linear,
        of_expanded: &[f32],
    ) {
        let (place, size) = (&block.expand, tape.size_in);
        let row = size.width * place.channels;
        let images = tape.input.par_chunks(image_size.pixels()).enumerate();
        let of_weights = total(images.map(|(index, image)| {
            let mut sums = vec![0.0; stem::TAPS * place.channels];
            let mut of_pixels = self.pool.take(row);
            for y in 0..size.height {
                let at = (index * size.height + y) * row;
                combine(
                    &of_expanded[at..at + row],
                    &tape.expand.pixels[at..at + row],
                    linear,
                    1.0,
                    &mut of_pixels,
                );
                stem::add_weight_gradient(image, image_size.width, y, &of_pixels, &mut sums);
            }
            sums
        }));
        self.gradients[place.weight.clone()]
            .copy_from_slice(&channels_first(&of_weights, place.channels));
    }
}

/// How the gradient of a depthwise convolution follows from that of its gated activation.
struct Gated {
    linear: Linear,
    /// [images, channels]
    pooled: Vec<f32>,
}

/// Rows of the gradient of the output that input row `y` contributed to, each with its row of the kernel.
fn rows_from<'a>(
    y: usize,
    kernel: usize,
    stride: usize,
    padding: usize,
    gradient: &'a Rows,
) -> Vec<(usize, &'a [f32])> {
    (0..kernel)
        .filter(|ky| y + padding >= *ky && (y + padding - ky).is_multiple_of(stride))
        .map(|ky| (ky, (y + padding - ky) / stride))
        .filter(|(_, from)| *from < gradient.height)
        .map(|(ky, from)| (ky, gradient.padded(from as isize)))
        .collect()
}

/// Two rows of sums times one factor for each channel.
fn scaled(sums: &[f64], factors: &[f32]) -> Vec<f64> {
    sums.iter()
        .zip(factors.iter().cycle())
        .map(|(sum, factor)| sum * f64::from(*factor))
        .collect()
}
