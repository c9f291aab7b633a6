// Times every registered body: a time is that of one call.
#include <benchmark/benchmark.h>

#include "host_tests/benchmarks/body.hpp"

int main(int argc, char** argv) {
  for (const auto& body : cutforce::benchmarks::bodies()) {
    benchmark::RegisterBenchmark(body.name().c_str(), [body](benchmark::State& state) {
      constexpr int kBatch = 1000;
      const auto repeat = body.prepare();
      while (state.KeepRunningBatch(kBatch)) repeat(kBatch);
    });
  }
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
}
