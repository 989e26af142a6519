// What is made when it is first asked for, once, and shared by all copies; any thread may ask.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <utility>

namespace nurbs {

template <class T>
class Lazy {
 public:
  // What `make()` returns, the first time.
  template <class Make>
  const T& get(const Make& make) const {
    std::call_once(made_->once, [&] { put(make()); });
    return made_->what;
  }
  bool made() const { return made_->done; }
  // Empty if it is not made.
  const T& known() const {
    static const T none;
    return made_->done ? made_->what : none;
  }
  // One made elsewhere, unless it is made already.
  void set(T what) const {
    std::call_once(made_->once, [&] { put(std::move(what)); });
  }

 private:
  struct Made {
    std::once_flag once;
    std::atomic<bool> done{false};
    T what;
  };
  void put(T what) const {
    made_->what = std::move(what);
    made_->done = true;
  }
  std::shared_ptr<Made> made_ = std::make_shared<Made>();
};

}  // namespace nurbs
