// Kernels on channels-last images and on flat parameters. Each value of `out` is written by one thread and summed in a fixed order,
// so that equal inputs give equal bytes. Plain C but for KERNEL, which declares a kernel, INLINE, which declares a function of
// kernels, and THREAD, the number of the thread: a test compiles the same text for the CPU. Loops of sums are unrolled so that a
// thread waits for several loads at once.

#ifdef __CUDACC__
#define KERNEL extern "C" __global__ void
#define INLINE __device__ __forceinline__
#define THREAD (blockIdx.x * blockDim.x + threadIdx.x)
#endif

// A normalisation is `norm` [mean, scale, bias, 1 / sigma and unbiased variance, channels]: z = scale (x - mean) + bias.
INLINE float normed(float x, const float *norm, int channel, int channels) {
    return norm[channels + channel] * (x - norm[channel]) + norm[2 * channels + channel];
}

INLINE float sigmoid(float z) { return 1.0f / (1.0f + expf(-z)); }

// SiLU z s(z), where s is the sigmoid, and its derivative.
INLINE float silu(float z) { return z * sigmoid(z); }

INLINE float silu_derivative(float z) {
    const float s = sigmoid(z);
    return s * (1.0f + z * (1.0f - s));
}

// Bits of `form`: which of image, factor and addend are given, and whether SiLU follows. For a missing one any pointer is passed, which is
// not read.
#define IMAGE 1
#define FACTOR 2
#define ADDEND 4
#define ACTIVATED 8

// The gradient of z at a value of an image [images, pixels, channels]: image x factor + addend, both [images, channels], times the
// derivative of SiLU.
INLINE float gradient_of_z(int at, int pixels, int channels, int form, const float *x, const float *norm, const float *image,
                           const float *factor, const float *addend) {
    const int channel = at % channels;
    const int place = at / channels / pixels * channels + channel;
    float gradient = form & IMAGE ? image[at] : 0.0f;
    if (form & FACTOR) gradient *= factor[place];
    if (form & ADDEND) gradient += addend[place];
    if (form & ACTIVATED) gradient *= silu_derivative(normed(x[at], norm, channel, channels));
    return gradient;
}

// Neighbouring columns that a thread of the next two kernels writes.
#define COLUMNS 4

// The columns that a thread of the next kernel writes. Kernel and stride are known when this is compiled, so that loops are unrolled.
INLINE void columns_of_depthwise(float *out, const float *x, const float *weights, int thread, int height, int width,
                                 int inputs, int rows, int columns, int channels, const int kernel, const int stride) {
    const int groups = (columns + COLUMNS - 1) / COLUMNS, padding = (kernel - 1) / 2;
    const int channel = thread % channels, column = thread / channels % groups * COLUMNS;
    const int row = thread / channels / groups % rows, image = thread / channels / groups / rows;
    const int input = channel % inputs, left = column * stride - padding;
    float sums[COLUMNS] = {0.0f};
#pragma unroll
    for (int ky = 0; ky < kernel; ky++) {
        const int y = row * stride + ky - padding;
        if (y < 0 || y >= height) continue;
        const float *line = x + (image * height + y) * width * inputs + input;
        // Each value of the line is loaded once for all windows that it lies in.
#pragma unroll
        for (int offset = 0; offset < (COLUMNS - 1) * stride + kernel; offset++) {
            const int at = left + offset;
            const float value = at >= 0 && at < width ? line[at * inputs] : 0.0f;
#pragma unroll
            for (int j = 0; j < COLUMNS; j++) {
                const int kx = offset - j * stride;
                if (kx >= 0 && kx < kernel) sums[j] += value * weights[(ky * kernel + kx) * channels + channel];
            }
        }
    }
    float *written = out + ((image * rows + row) * columns + column) * channels + channel;
#pragma unroll
    for (int j = 0; j < COLUMNS; j++)
        if (column + j < columns) written[j * channels] = sums[j];
}

// out [images, rows, columns, channels]: convolution of each channel of x [images, height, width, inputs] by its own weights
// [kernel, kernel, channels] of windows of 3 or 5 with a stride of 1 or 2, with zeros around the image; a single input is every
// channel's.
KERNEL depthwise(float *out, const float *x, const float *weights, int threads, int height, int width, int inputs,
                 int rows, int columns, int channels, int kernel, int stride) {
    const int thread = THREAD;
    if (thread >= threads) return;
    if (kernel == 3 && stride == 1)
        columns_of_depthwise(out, x, weights, thread, height, width, inputs, rows, columns, channels, 3, 1);
    else if (kernel == 3)
        columns_of_depthwise(out, x, weights, thread, height, width, inputs, rows, columns, channels, 3, 2);
    else if (stride == 1)
        columns_of_depthwise(out, x, weights, thread, height, width, inputs, rows, columns, channels, 5, 1);
    else
        columns_of_depthwise(out, x, weights, thread, height, width, inputs, rows, columns, channels, 5, 2);
}

// The columns that a thread of the next kernel writes. With a stride of 2, only every second tap reaches a column; which ones is known
// when this is compiled, since the first column is even.
INLINE void columns_of_input(float *out, const float *gradient, const float *weights, int thread, int height, int width,
                             int rows, int columns, int channels, const int kernel, const int stride) {
    const int groups = (width + COLUMNS - 1) / COLUMNS, padding = (kernel - 1) / 2;
    const int channel = thread % channels, left = thread / channels % groups * COLUMNS;
    const int y = thread / channels / groups % height, image = thread / channels / groups / height;
    float sums[COLUMNS] = {0.0f};
#pragma unroll
    for (int ky = 0; ky < kernel; ky++) {
        const int row = (y + padding - ky) / stride;
        if (y + padding < ky || (y + padding - ky) % stride || row >= rows) continue;
        const float *line = gradient + (image * rows + row) * columns * channels + channel;
#pragma unroll
        for (int j = 0; j < COLUMNS; j++) {
#pragma unroll
            for (int kx = 0; kx < kernel; kx++) {
                if ((j + padding - kx + kernel * stride) % stride) continue;
                const int at = left + j + padding - kx, column = at / stride;
                if (at >= 0 && column < columns)
                    sums[j] += line[column * channels] * weights[(ky * kernel + kx) * channels + channel];
            }
        }
    }
    float *written = out + ((image * height + y) * width + left) * channels + channel;
#pragma unroll
    for (int j = 0; j < COLUMNS; j++)
        if (left + j < width) written[j * channels] = sums[j];
}

// out [images, height, width, channels]: the gradient of x from that of the convolution's output [images, rows, columns, channels].
KERNEL depthwise_of_input(float *out, const float *gradient, const float *weights, int threads, int height, int width,
                          int rows, int columns, int channels, int kernel, int stride) {
    const int thread = THREAD;
    if (thread >= threads) return;
    if (kernel == 3 && stride == 1)
        columns_of_input(out, gradient, weights, thread, height, width, rows, columns, channels, 3, 1);
    else if (kernel == 3)
        columns_of_input(out, gradient, weights, thread, height, width, rows, columns, channels, 3, 2);
    else if (stride == 1)
        columns_of_input(out, gradient, weights, thread, height, width, rows, columns, channels, 5, 1);
    else
        columns_of_input(out, gradient, weights, thread, height, width, rows, columns, channels, 5, 2);
}

// The sums of a thread of the next kernel. `kernel` is known when this is compiled, so that they stay in registers.
INLINE void sums_of_weights(float *out, const float *x, const float *gradient, int thread, int lines, int height, int width,
                            int inputs, int rows, int columns, int channels, const int kernel, int stride, int parts) {
    const int channel = thread % channels, part = thread / channels;
    const int padding = (kernel - 1) / 2, input = channel % inputs;
    float sums[25] = {0.0f};
    for (int line = part; line < lines; line += parts) {
        const int top = line % rows * stride - padding;
        const float *image = x + line / rows * height * width * inputs + input;
        for (int column = 0; column < columns; column++) {
            const int left = column * stride - padding;
            const float g = gradient[(line * columns + column) * channels + channel];
#pragma unroll
            for (int tap = 0; tap < kernel * kernel; tap++) {
                const int y = top + tap / kernel, at = left + tap % kernel;
                const int inside = y >= 0 && y < height && at >= 0 && at < width;
                if (inside) sums[tap] += g * image[(y * width + at) * inputs];
            }
        }
    }
#pragma unroll
    for (int tap = 0; tap < kernel * kernel; tap++) out[(part * kernel * kernel + tap) * channels + channel] = sums[tap];
}

// out [parts, kernel, kernel, channels]: the gradient of the weights, of windows of 3 or 5, from x and the gradient of the output;
// part p of the sum takes every parts-th row of all images' outputs from row p on.
KERNEL depthwise_of_weights(float *out, const float *x, const float *gradient, int threads, int lines, int height, int width,
                            int inputs, int rows, int columns, int channels, int kernel, int stride, int parts) {
    const int thread = THREAD;
    if (thread >= threads) return;
    if (kernel == 3)
        sums_of_weights(out, x, gradient, thread, lines, height, width, inputs, rows, columns, channels, 3, stride, parts);
    else
        sums_of_weights(out, x, gradient, thread, lines, height, width, inputs, rows, columns, channels, 5, stride, parts);
}

// out [groups, values]: sums of `group` parts, the last of fewer, of in [parts, values].
KERNEL sum_parts(float *out, const float *in, int threads, int values, int parts, int group) {
    const int thread = THREAD;
    if (thread >= threads) return;
    const int value = thread % values, first = thread / values * group;
    const int end = first + group < parts ? first + group : parts;
    float sum = 0.0f;
#pragma unroll 8
    for (int part = first; part < end; part++) sum += in[part * values + value];
    out[thread] = sum;
}

// out [parts, 2, channels]: of x [pixels, channels] the sums of x - c and of its square, c being the channel's first value; part p
// of the sums takes every parts-th pixel from pixel p on.
KERNEL moments(float *out, const float *x, int threads, int pixels, int channels, int parts) {
    const int thread = THREAD;
    if (thread >= threads) return;
    const int channel = thread % channels, part = thread / channels;
    const float center = x[channel];
    float first = 0.0f, second = 0.0f;
#pragma unroll 8
    for (int pixel = part; pixel < pixels; pixel += parts) {
        const float d = x[pixel * channels + channel] - center;
        first += d;
        second += d * d;
    }
    out[2 * part * channels + channel] = first;
    out[(2 * part + 1) * channels + channel] = second;
}

// Writes the normalisation of a channel. The variance that is added to is torch's 1e-5.
INLINE void write_norm(float *out, const float *affine, int channel, int channels, float mean, float variance, float unbiased) {
    const float inverse = 1.0f / sqrtf(variance + 1e-5f);
    out[channel] = mean;
    out[channels + channel] = affine[channel] * inverse;
    out[2 * channels + channel] = affine[channels + channel];
    out[3 * channels + channel] = inverse;
    out[4 * channels + channel] = unbiased;
}

// The normalisation of x by a batch, from the sums [2, channels] of its moments; affine is [weight and bias, channels].
KERNEL norm_of_batch(float *out, const float *sums, const float *x, const float *affine, int threads, int pixels) {
    const int channel = THREAD, channels = threads;
    if (channel >= channels) return;
    const float offset = sums[channel] / pixels;
    const float variance = fmaxf(sums[channels + channel] / pixels - offset * offset, 0.0f);
    write_norm(out, affine, channel, channels, x[channel] + offset, variance, variance * pixels / (pixels - 1));
}

// The normalisation by constant moments [channels].
KERNEL norm_of_moments(float *out, const float *mean, const float *variance, const float *affine, int threads) {
    const int channel = THREAD, channels = threads;
    if (channel >= channels) return;
    write_norm(out, affine, channel, channels, mean[channel], variance[channel], variance[channel]);
}

// out [images, pixels, channels]: z or SiLU(z), times a factor [images, channels], plus an addend of the shape of x.
KERNEL normalise(float *out, const float *x, const float *norm, const float *factor, const float *addend, int threads,
                 int pixels, int channels, int form) {
    const int thread = THREAD;
    if (thread >= threads) return;
    const int channel = thread % channels;
    float value = normed(x[thread], norm, channel, channels);
    if (form & ACTIVATED) value = silu(value);
    if (form & FACTOR) value *= factor[thread / channels / pixels * channels + channel];
    if (form & ADDEND) value += addend[thread];
    out[thread] = value;
}

// out [parts, images, channels]: sums over an image of SiLU(z) times another image, or its mean; parts as for the moments.
KERNEL pool(float *out, const float *x, const float *norm, const float *image, int threads, int values, int pixels,
            int channels, int parts, int form) {
    const int thread = THREAD;
    if (thread >= threads) return;
    const int channel = thread % channels, first = thread % values / channels * pixels;
    float sum = 0.0f;
#pragma unroll 8
    for (int pixel = thread / values; pixel < pixels; pixel += parts) {
        const int at = (first + pixel) * channels + channel;
        const float value = silu(normed(x[at], norm, channel, channels));
        sum += form & IMAGE ? value * image[at] : value;
    }
    out[thread] = form & IMAGE ? sum : sum / pixels;
}

// out [parts, 2, channels]: the sums of the gradient of z, and of it times x - mean; parts as for the moments.
KERNEL normalise_of_affine(float *out, const float *x, const float *norm, const float *image, const float *factor,
                           const float *addend, int threads, int all_pixels, int pixels, int channels, int form,
                           int parts) {
    const int thread = THREAD;
    if (thread >= threads) return;
    const int channel = thread % channels, part = thread / channels;
    float first = 0.0f, second = 0.0f;
#pragma unroll 4
    for (int pixel = part; pixel < all_pixels; pixel += parts) {
        const int at = pixel * channels + channel;
        const float g = gradient_of_z(at, pixels, channels, form, x, norm, image, factor, addend);
        first += g;
        second += g * (x[at] - norm[channel]);
    }
    out[2 * part * channels + channel] = first;
    out[(2 * part + 1) * channels + channel] = second;
}

// out [4, channels]: the gradients of weight and bias of a normalisation by a batch, then b and c of the next kernel, from the sums
// of the last one (Ioffe and Szegedy 2015, arXiv:1502.03167, section 3).
KERNEL normalise_of_sums(float *out, const float *sums, const float *norm, int threads, int all_pixels) {
    const int channel = THREAD, channels = threads;
    if (channel >= channels) return;
    const float of_bias = sums[channel], of_weight = sums[channels + channel] * norm[3 * channels + channel];
    const float each = -norm[channels + channel] / all_pixels;
    out[channel] = of_weight;
    out[channels + channel] = of_bias;
    out[2 * channels + channel] = each * norm[3 * channels + channel] * of_weight;
    out[3 * channels + channel] = each * of_bias;
}

// out [images, pixels, channels]: the gradient of x, scale g + b (x - mean) + c for the gradient g of z.
KERNEL normalise_of_input(float *out, const float *x, const float *norm, const float *image, const float *factor,
                          const float *addend, const float *of_sums, int threads, int pixels, int channels, int form) {
    const int thread = THREAD;
    if (thread >= threads) return;
    const int channel = thread % channels;
    const float g = gradient_of_z(thread, pixels, channels, form, x, norm, image, factor, addend);
    out[thread] = norm[channels + channel] * g + of_sums[2 * channels + channel] * (x[thread] - norm[channel]) +
                  of_sums[3 * channels + channel];
}

// The gradient of x from that of its sigmoid y.
KERNEL sigmoid_of_input(float *out, const float *y, const float *gradient, int threads) {
    const int thread = THREAD;
    if (thread >= threads) return;
    out[thread] = gradient[thread] * y[thread] * (1.0f - y[thread]);
}

// The gradient of x from that of SiLU(x).
KERNEL silu_of_input(float *out, const float *x, const float *gradient, int threads) {
    const int thread = THREAD;
    if (thread >= threads) return;
    out[thread] = gradient[thread] * silu_derivative(x[thread]);
}

// out [2, parameters]: Adam's running means of the gradient and of its square after another gradient.
KERNEL adam_moments(float *out, const float *moments, const float *gradient, int threads, float share_1, float share_2) {
    const int thread = THREAD;
    if (thread >= threads) return;
    const float g = gradient[thread], m = moments[thread], v = moments[threads + thread];
    out[thread] = m + (g - m) * share_1;
    out[threads + thread] = (1.0f - share_2) * v + share_2 * g * g;
}

// out [parameters]: the parameters after Adam's step.
KERNEL adam_step(float *out, const float *parameters, const float *moments, int threads, float scale, float correction,
                 float epsilon) {
    const int thread = THREAD;
    if (thread >= threads) return;
    const float divisor = sqrtf(moments[threads + thread]) / correction + epsilon;
    out[thread] = parameters[thread] - scale * moments[thread] / divisor;
}

// out [parameters]: a moving average after other values.
KERNEL move_average(float *out, const float *average, const float *values, int threads, float share) {
    const int thread = THREAD;
    if (thread >= threads) return;
    out[thread] = average[thread] + share * (values[thread] - average[thread]);
}
