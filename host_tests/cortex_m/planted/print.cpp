#include <cstdio>

extern "C" int planted(int value) { return std::printf("%d", value); }
