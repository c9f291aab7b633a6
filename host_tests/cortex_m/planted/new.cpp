extern "C" int* planted(unsigned size) { return new int[size]; }
