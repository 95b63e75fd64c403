// Which step gives an error or a size? Asked of a sample of families, and corrected by the counts of all details:
// the coarser levels and the sample are all that is quantised for an answer.
#pragma once

#include <array>
#include <functional>

#include "plugins/codec-wavelet/analysis.h"

namespace voxloom::wavelet {

// What a quantiser would give for the whole volume.
struct Estimate {
    double mse = 0;    // mean squared error of level 0
    double bytes = 0;  // of the whole file; 0 where nobody asked
};

class StepSearch {
  public:
    // `e` was analysed, with counts; its quantiser is what is looked for. `rounds` counts the trials.
    StepSearch(Encoding& e, int& rounds);

    void set_step(double step);
    // What the quantiser gives that `e.tree` has now.
    Estimate estimate(bool with_bytes);
    // If nothing is lost.
    double lossless_bytes();

    // Sets the step whose mean squared error, or size, is nearly this. The size errs by `overhead` bytes.
    void find_mse(double mse);
    void find_bytes(double bytes, double overhead);
    // A step from an emission's truth: error or size was `got` and should be `wanted`.
    void correct_mse(double got, double wanted);
    void correct_bytes(double got, double wanted);

  private:
    enum class Order { given, any };  // any: in parallel within a level
    template <class Use>
    void sweep(const FamilyCodec& codec, Order order, const Use& use);
    void find(double start, double goal, double slope, const std::function<double()>& measure);
    double start_of(double goal, const std::function<double()>& model);

    Encoding& e_;
    int& rounds_;
    struct Tried {
        std::int64_t family = 0;
        double weight = 0;  // how many families of its level it stands for
        Sample::Kept kept;  // of level 0
    };
    int shift_ = 0;  // the levels' integers have so many bits more than those of the tree that is tried
    std::vector<std::vector<Tried>> families_;  // of each level: those of level 0 and their ancestors
    CoefficientCounts counts_;                  // of these families alone
};

}  // namespace voxloom::wavelet
