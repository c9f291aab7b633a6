#include "estimator/fault.hpp"
