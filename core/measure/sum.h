// Sums of very many numbers that do not lose the small ones.
#pragma once

#include <cmath>

namespace voxloom {

// Kahan's compensated sum in Neumaier's form: the error does not grow with the number of terms.
// Order matters to the last bit: add in an order that does not depend on threads.
class Sum {
  public:
    void add(double v) {
        double t = sum_ + v;
        lost_ += std::abs(sum_) >= std::abs(v) ? (sum_ - t) + v : (v - t) + sum_;
        sum_ = t;
    }
    void add(const Sum& other) {
        add(other.sum_);
        lost_ += other.lost_;
    }
    double value() const { return std::isfinite(sum_) ? sum_ + lost_ : sum_; }

  private:
    double sum_ = 0, lost_ = 0;
};

}  // namespace voxloom
