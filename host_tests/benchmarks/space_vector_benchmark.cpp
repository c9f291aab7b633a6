#include "estimator/space_vector.hpp"
#include "host_tests/benchmarks/body.hpp"

namespace cutforce::benchmarks {
namespace {

// The smallest thing the sample path does: instantaneous power of one sample.
const Body kPower{"space_vector_dot", [] {
                    estimator::MotorSample sample{.voltage_v = {.alpha = 200.0F, .beta = 100.0F},
                                                  .current_a = {.alpha = 4.0F, .beta = 3.0F}};
                    return [sample]() mutable {
                      forget(sample);
                      keep(1.5F * estimator::dot(sample.voltage_v, sample.current_a));
                    };
                  }};

}  // namespace
}  // namespace cutforce::benchmarks
