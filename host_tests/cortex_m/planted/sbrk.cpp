extern "C" void* _sbrk(int);

extern "C" void* planted(int more) { return _sbrk(more); }
