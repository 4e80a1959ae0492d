// Kernels on channels-last images, each value of `out` written by one thread and summed in a fixed order, so that equal inputs
// give equal bytes. Plain C but for KERNEL, which declares a kernel, and THREAD, the number of the thread: a test compiles
// the same text for the CPU.

#ifdef __CUDACC__
#define KERNEL extern "C" __global__ void
#define THREAD (blockIdx.x * blockDim.x + threadIdx.x)
#endif

// out [images, rows, columns, channels]: convolution of each channel of x [images, height, width, inputs] by its own weights
// [channels, kernel, kernel], with zeros around the image; a single input is every channel's.
KERNEL depthwise(float *out, const float *x, const float *weights, int threads, int height, int width, int inputs,
                 int rows, int columns, int channels, int kernel, int stride) {
    const int thread = THREAD;
    if (thread >= threads) return;
    const int channel = thread % channels, column = thread / channels % columns;
    const int row = thread / channels / columns % rows, image = thread / channels / columns / rows;
    const int padding = (kernel - 1) / 2;
    float sum = 0.0f;
    for (int ky = 0; ky < kernel; ky++) {
        const int y = row * stride + ky - padding;
        if (y < 0 || y >= height) continue;
        for (int kx = 0; kx < kernel; kx++) {
            const int at = column * stride + kx - padding;
            if (at < 0 || at >= width) continue;
            sum += x[((image * height + y) * width + at) * inputs + channel % inputs] *
                   weights[(channel * kernel + ky) * kernel + kx];
        }
    }
    out[thread] = sum;
}

// out [images, height, width, channels]: the gradient of x from that of the convolution's output [images, rows, columns, channels].
KERNEL depthwise_of_input(float *out, const float *gradient, const float *weights, int threads, int height, int width,
                          int rows, int columns, int channels, int kernel, int stride) {
    const int thread = THREAD;
    if (thread >= threads) return;
    const int channel = thread % channels, at = thread / channels % width;
    const int y = thread / channels / width % height, image = thread / channels / width / height;
    const int padding = (kernel - 1) / 2;
    float sum = 0.0f;
    for (int ky = 0; ky < kernel; ky++) {
        const int row = (y + padding - ky) / stride;
        if (y + padding < ky || (y + padding - ky) % stride || row >= rows) continue;
        for (int kx = 0; kx < kernel; kx++) {
            const int column = (at + padding - kx) / stride;
            if (at + padding < kx || (at + padding - kx) % stride || column >= columns) continue;
            sum += gradient[((image * rows + row) * columns + column) * channels + channel] *
                   weights[(channel * kernel + ky) * kernel + kx];
        }
    }
    out[thread] = sum;
}

// out [parts, kernel, kernel, channels]: the gradient of the weights from x and the gradient of the output; part p of the sum
// takes every parts-th row of all images' outputs from row p on.
KERNEL depthwise_of_weights(float *out, const float *x, const float *gradient, int threads, int height, int width,
                            int inputs, int rows, int columns, int channels, int kernel, int stride, int all_rows,
                            int parts) {
    const int thread = THREAD;
    if (thread >= threads) return;
    const int channel = thread % channels, kx = thread / channels % kernel;
    const int ky = thread / channels / kernel % kernel, part = thread / channels / kernel / kernel;
    const int padding = (kernel - 1) / 2;
    float sum = 0.0f;
    for (int line = part; line < all_rows; line += parts) {
        const int y = line % rows * stride + ky - padding;
        if (y < 0 || y >= height) continue;
        for (int column = 0; column < columns; column++) {
            const int at = column * stride + kx - padding;
            if (at < 0 || at >= width) continue;
            sum += x[((line / rows * height + y) * width + at) * inputs + channel % inputs] *
                   gradient[(line * columns + column) * channels + channel];
        }
    }
    out[thread] = sum;
}

// out [parts, 2, channels]: of x [pixels, channels] the sums of x - center and of its square; part p of the sums takes every
// parts-th pixel from pixel p on.
KERNEL moments(float *out, const float *x, const float *center, int threads, int pixels, int channels, int parts) {
    const int thread = THREAD;
    if (thread >= threads) return;
    const int channel = thread % channels, part = thread / channels;
    float first = 0.0f, second = 0.0f;
    for (int pixel = part; pixel < pixels; pixel += parts) {
        const float d = x[pixel * channels + channel] - center[channel];
        first += d;
        second += d * d;
    }
    out[2 * part * channels + channel] = first;
    out[(2 * part + 1) * channels + channel] = second;
}

// out [pixels, channels]: z = scale (x - mean) + bias, of `norm` [mean, scale and bias, channels].
KERNEL normalise(float *out, const float *x, const float *norm, int threads, int channels) {
    const int thread = THREAD;
    if (thread >= threads) return;
    const int channel = thread % channels;
    out[thread] = norm[channels + channel] * (x[thread] - norm[channel]) + norm[2 * channels + channel];
}

// out [pixels, channels]: SiLU z s(z) of the same z, where s(z) = 1 / (1 + exp(-z)).
KERNEL activate(float *out, const float *x, const float *norm, int threads, int channels) {
    const int thread = THREAD;
    if (thread >= threads) return;
    const int channel = thread % channels;
    const float z = norm[channels + channel] * (x[thread] - norm[channel]) + norm[2 * channels + channel];
    out[thread] = z / (1.0f + expf(-z));
}

// out [pixels, channels]: the gradient of z from that of SiLU.
KERNEL activate_of_normed(float *out, const float *x, const float *gradient, const float *norm, int threads, int channels) {
    const int thread = THREAD;
    if (thread >= threads) return;
    const int channel = thread % channels;
    const float z = norm[channels + channel] * (x[thread] - norm[channel]) + norm[2 * channels + channel];
    const float s = 1.0f / (1.0f + expf(-z));
    out[thread] = gradient[thread] * s * (1.0f + z * (1.0f - s));
}

// out [parts, 2, channels]: the sums of the gradient of z, and of it times x - mean; parts as for the moments.
KERNEL normalise_of_affine(float *out, const float *x, const float *gradient, const float *mean, int threads, int pixels,
                           int channels, int parts) {
    const int thread = THREAD;
    if (thread >= threads) return;
    const int channel = thread % channels, part = thread / channels;
    float first = 0.0f, second = 0.0f;
    for (int pixel = part; pixel < pixels; pixel += parts) {
        const float g = gradient[pixel * channels + channel];
        first += g;
        second += g * (x[pixel * channels + channel] - mean[channel]);
    }
    out[2 * part * channels + channel] = first;
    out[(2 * part + 1) * channels + channel] = second;
}

// out [pixels, channels]: the gradient of x, a g + b (x - mean) + c for the gradient g of z and `linear` [mean, a, b and c, channels].
KERNEL normalise_of_input(float *out, const float *x, const float *gradient, const float *linear, int threads, int channels) {
    const int thread = THREAD;
    if (thread >= threads) return;
    const int channel = thread % channels;
    out[thread] = linear[channels + channel] * gradient[thread] +
                  linear[2 * channels + channel] * (x[thread] - linear[channel]) + linear[3 * channels + channel];
}
