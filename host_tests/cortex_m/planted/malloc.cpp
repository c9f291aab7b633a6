#include <cstdlib>

extern "C" void* planted(unsigned size) { return std::malloc(size); }
