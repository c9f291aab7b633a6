#include "firmware/machine.hpp"
