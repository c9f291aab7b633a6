// A public virtual destructor brings operator delete, although nobody deletes.
struct Base {
  virtual ~Base();
  virtual int value() = 0;
};
Base::~Base() = default;
struct Derived final : Base {
  int value() override { return 1; }
};

Derived derived_value{};

extern "C" int planted(int) { return static_cast<Base&>(derived_value).value(); }
