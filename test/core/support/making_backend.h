#pragma once

#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "stepdriver_core/gpio/lines.h"

namespace stepdriver::test {

/// A backend whose lines a function makes.
class MakingBackend : public gpio::Backend {
 public:
  using Make =
      std::function<std::unique_ptr<gpio::Lines>(const std::vector<gpio::OutputRequest>& outputs,
                                                 const std::vector<gpio::InputRequest>& inputs)>;

  explicit MakingBackend(Make make) : make_(std::move(make)) {}
  std::unique_ptr<gpio::Lines> request(const std::vector<gpio::OutputRequest>& outputs,
                                       const std::vector<gpio::InputRequest>& inputs) override {
    return make_(outputs, inputs);
  }

 private:
  const Make make_;
};

}  // namespace stepdriver::test
