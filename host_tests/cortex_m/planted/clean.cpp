// Links: what the violations beside it are held against.
extern "C" int planted(int value) { return value + 1; }
