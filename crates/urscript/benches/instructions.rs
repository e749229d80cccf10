//! What a cycle of a program costs: one that computes through its share, and one that streams set-points.
//!
//! `cargo bench -p needlebench-urscript`. A pass of the loop that computes has 9 instructions.
#![expect(missing_docs, reason = "criterion writes the functions")]

#[path = "../tests/urscript/test_arm.rs"]
#[expect(dead_code, reason = "shared with the tests")]
mod test_arm;
#[path = "../tests/urscript/test_host.rs"]
#[expect(dead_code, reason = "shared with the tests")]
mod test_host;

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use needlebench_urscript::{Bank, Program, Run, Signal};

use crate::test_host::TestHost;

fn cycles(criterion: &mut Criterion) {
    let control = include_str!("../tests/urscript/control.script");
    let sums = "def p(): def sum(n): i = 0 while i < n: i = i + 1 end return i end \
                while True: x = sum(400) sync() end end";
    let lists = "q = [1, 2, 3, 4, 5, 6] while True: \
                 i = 0 while i < 100: q[i % 6] = q[0] + 1 i = i + 1 end sync() end";
    let mut group = criterion.benchmark_group("cycle");
    for (name, text, instructions) in [
        ("control program", control, None),
        ("lists", lists, None),
        ("sums", sums, Some(400 * 9)),
    ] {
        if let Some(instructions) = instructions {
            group.throughput(Throughput::Elements(instructions));
        }
        let program = Program::load(text).expect("a program");
        group.bench_function(name, |bencher| {
            let mut host = TestHost::new();
            let mut run = Run::new(program.clone());
            let mut cycle = 0;
            bencher.iter(|| {
                let beat = Signal::Integer(cycle);
                host.signals.insert((Bank::InputInteger, 2), beat);
                cycle += 1;
                host.trace.clear();
                black_box(host.step(&mut run))
            });
        });
    }
    group.finish();
    let mut group = criterion.benchmark_group("load");
    group.throughput(Throughput::Bytes(control.len() as u64));
    group.bench_function("control program", |bencher| {
        bencher.iter(|| Program::load(black_box(control)));
    });
    group.finish();
}

criterion_group!(benches, cycles);
criterion_main!(benches);
