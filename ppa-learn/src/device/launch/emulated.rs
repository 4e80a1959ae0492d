//! Emulation of the kernels as plain C on the CPU, one thread after the other, with memory accesses checked if the compiler supports it.

use std::fs;
use std::io::{Read, Write};
use std::process::{Child, Command, Output, Stdio};
use std::sync::{LazyLock, Mutex, PoisonError};

use candle_core::{CpuStorage, Result};

use super::{Given, KERNELS, Launch};

/// Program that runs one kernel after the other. It reads the number of a kernel, the length of the output, the inputs, each after
/// its length, the integers and the floats; it writes the output.
static EMULATOR: LazyLock<Mutex<Child>> = LazyLock::new(|| Mutex::new(start()));

const BEFORE: &str = "
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
static int number;
#define KERNEL static void
#define INLINE static inline
#define THREAD number
";

/// CASES read the arguments of a kernel and call it for every thread of whole blocks, as on a device.
const AFTER: &str = "
static void take(void *values, size_t length) {
    if (fread(values, 4, length, stdin) != length) exit(0);
}
static float *take_input(void) {
    int length;
    take(&length, 1);
    float *input = malloc(4 * (size_t)length);
    take(input, length);
    return input;
}
#define RUN(INPUTS, INTEGERS, FLOATS, CALL) \\
    for (int i = 0; i < INPUTS; i++) in[i] = take_input(); \\
    take(n, INTEGERS); \\
    take(f, FLOATS); \\
    for (number = 0; number < (n[0] + 255) / 256 * 256; number++) CALL; \\
    break;
int main(void) {
    for (;;) {
        int kernel, length, n[16];
        float *in[6] = {NULL}, f[4];
        take(&kernel, 1);
        take(&length, 1);
        float *out = malloc(4 * (size_t)length);
        for (int i = 0; i < length; i++) out[i] = NAN;
        switch (kernel) { CASES }
        if (fwrite(out, 4, length, stdout) != (size_t)length || fflush(stdout)) return 1;
        for (int i = 0; i < 6; i++) free(in[i]);
        free(out);
    }
}
";

pub fn run(launch: &Launch, given: &Given<CpuStorage>) -> Result<CpuStorage> {
    let Given {
        inputs,
        integers,
        floats,
    } = given;
    let declared = declared();
    let kernel = declared
        .iter()
        .position(|(name, ..)| *name == launch.kernel);
    let kernel = kernel.unwrap_or_else(|| panic!("there is no kernel {}", launch.kernel));
    let expected = (launch.kernel, inputs.len(), integers.len(), floats.len());
    assert_eq!(declared[kernel], expected, "name, inputs, integers, floats");

    let length = launch.out.elem_count();
    let head = [kernel as i32, length as i32].map(i32::to_le_bytes);
    let mut request = head.as_flattened().to_vec();
    for (storage, place) in inputs {
        request.extend((place.len() as i32).to_le_bytes());
        let values = &storage.as_slice::<f32>()?[place.clone()];
        request.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    }
    request.extend(integers.iter().flat_map(|integer| integer.to_le_bytes()));
    request.extend(floats.iter().flat_map(|float| float.to_le_bytes()));

    let mut emulator = EMULATOR.lock().unwrap_or_else(PoisonError::into_inner);
    let pipe = "both were asked for";
    emulator.stdin.as_mut().expect(pipe).write_all(&request)?;
    let mut made = vec![0; 4 * length];
    let read = emulator.stdout.as_mut().expect(pipe).read_exact(&mut made);
    read.unwrap_or_else(|error| panic!("{launch:?} failed, see above: {error}"));
    let values = made.as_chunks().0.iter();
    let values = values.map(|&value| f32::from_le_bytes(value)).collect();
    Ok(CpuStorage::F32(values))
}

/// The name of each kernel, and the numbers of its inputs, integers and floats.
fn declared() -> Vec<(&'static str, usize, usize, usize)> {
    let declaration = |text: &'static str| {
        let (name, parameters) = text.split_once('(').expect("parameters");
        let (parameters, _) = parameters.split_once(')').expect("parameters");
        let count = |what| parameters.matches(what).count();
        let floats = count("float ") - count("float *");
        (name, count("const float *"), count("int "), floats)
    };
    KERNELS
        .split("\nKERNEL ")
        .skip(1)
        .map(declaration)
        .collect()
}

fn start() -> Child {
    let cases = declared().into_iter().enumerate();
    let cases = cases.map(|(number, (name, inputs, integers, floats))| {
        let named = |array, count| (0..count).map(move |i| format!("{array}[{i}]"));
        let given = named("in", inputs).chain(named("n", integers));
        let arguments: Vec<String> = given.chain(named("f", floats)).collect();
        let call = format!("{name}(out, {})", arguments.join(", "));
        format!("case {number}: RUN({inputs}, {integers}, {floats}, {call})")
    });
    let cases: Vec<String> = cases.collect();
    let after = AFTER.replace("CASES", &cases.join("\n"));

    let folder = tempfile::tempdir().unwrap();
    let (source, program) = (
        folder.path().join("kernels.c"),
        folder.path().join("kernels"),
    );
    fs::write(&source, [BEFORE, KERNELS, &after].concat()).unwrap();
    let compile = |checks: &[&str]| -> Output {
        let mut command = Command::new("cc");
        command.args(["-std=gnu99", "-O2", "-o"]).arg(&program);
        command.arg(&source).args(checks).arg("-lm");
        command.output().expect("cc, which Rust links with")
    };
    // Not every compiler has the sanitizer libraries.
    let checked = compile(&["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]);
    if !checked.status.success() {
        let plain = compile(&[]);
        let errors = String::from_utf8_lossy(&plain.stderr);
        assert!(plain.status.success(), "{errors}");
    }
    let mut command = Command::new(&program);
    command.stdin(Stdio::piped()).stdout(Stdio::piped());
    command.spawn().unwrap()
}
