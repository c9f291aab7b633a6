#include "hal/port.hpp"
