#include "firmware/loop_output.hpp"
