#include "estimator/fault.hpp"

#include <gtest/gtest.h>

namespace cutforce {
namespace {

TEST(FaultSet, HoldsExactlyWhatWasInserted) {
  estimator::FaultSet faults;
  EXPECT_TRUE(faults.empty());
  faults.insert(estimator::Fault::kClipped);
  EXPECT_TRUE(faults.contains(estimator::Fault::kClipped));
  EXPECT_FALSE(faults.contains(estimator::Fault::kGap));
  EXPECT_EQ(estimator::kFaultNames[static_cast<std::size_t>(estimator::Fault::kClipped)],
            "clipped");
}

}  // namespace
}  // namespace cutforce
