// SPDX-License-Identifier: BSD-3-Clause
#include "slam/localization/particles.h"

#include <mrpt/bayes/CParticleFilter.h>
#include <mrpt/maps/COccupancyGridMap2D.h>
#include <mrpt/obs/CActionCollection.h>
#include <mrpt/obs/CActionRobotMovement2D.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <mrpt/poses/CPosePDFGaussian.h>
#include <mrpt/random.h>
#include <mrpt/slam/CMonteCarloLocalization2D.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "slam/basics/pose.h"

namespace kurumaisu {
namespace {

using mrpt::bayes::CParticleFilter;

CParticleFilter::TParticleFilterOptions filterOptions() {
  CParticleFilter::TParticleFilterOptions options;
  options.adaptiveSampleSize = true;
  options.PF_algorithm = CParticleFilter::pfStandardProposal;
  options.resamplingMethod = CParticleFilter::prMultinomial;
  options.powFactor = 1;
  return options;
}

mrpt::obs::CActionCollection action(const Gaussian& motion) {
  mrpt::obs::CActionRobotMovement2D movement;
  movement.estimationMethod = mrpt::obs::CActionRobotMovement2D::emScan2DMatching;
  mrpt::math::CMatrixDouble33 covariance;
  for (int i = 0; i < 9; ++i) covariance(i / 3, i % 3) = motion.covariance(i / 3, i % 3);
  movement.poseChange = mrpt::poses::CPosePDFGaussian::Create(
      mrpt::poses::CPose2D(motion.mean.x, motion.mean.y, wrapAngle(motion.mean.theta)), covariance);
  mrpt::obs::CActionCollection actions;
  actions.insert(movement);
  return actions;
}

}  // namespace

/// MRPT's filter with our sensor model: its own is read from MRPT's maps, which take all readings for
/// independent and search the walls for each.
struct Particles::Mcl : mrpt::slam::CMonteCarloLocalization2D {
  explicit Mcl(const LocalizerSettings& s) : CMonteCarloLocalization2D(1) {
    options.metricMap = mrpt::maps::COccupancyGridMap2D::Create();  // asked for, and not used
    auto& kld = options.KLD_params;
    kld.KLD_minSampleSize = static_cast<unsigned>(s.min_particles);
    kld.KLD_maxSampleSize = static_cast<unsigned>(s.max_particles);
    kld.KLD_epsilon = s.kld_err;
    kld.KLD_delta = 0.5 * std::erfc(s.kld_z / std::sqrt(2.0));
    kld.KLD_binSize_XY = kBin;
    kld.KLD_binSize_PHI = kBinAngle;
    filter.m_options = filterOptions();
    filter.setMinLoggingLevel(mrpt::system::LVL_ERROR);
  }

  double PF_SLAM_computeObservationLikelihoodForParticle(
      const CParticleFilter::TParticleFilterOptions& /*options*/, const size_t /*particle*/,
      const mrpt::obs::CSensoryFrame& /*frame*/, const mrpt::poses::CPose3D& pose) const override {
    return (*likelihood)({pose.x(), pose.y(), pose.yaw()});
  }

  // Of the histogram that counts how many particles are needed: half a metre and 10 degrees are AMCL's.
  static constexpr double kBin = 0.5;
  static constexpr double kBinAngle = 10 * M_PI / 180;

  CParticleFilter filter;
  const std::function<double(const Pose2D&)>* likelihood = nullptr;  ///< during an update
};

Particles::Particles(const LocalizerSettings& settings, std::uint32_t seed)
    : settings_(settings), seed_(seed), mcl_(std::make_unique<Mcl>(settings)) {}
Particles::~Particles() = default;

/// MRPT's generator belongs to the thread and keeps half a pair of normal draws over a new seed, so it is
/// replaced before every use.
void Particles::seedRandom() {
  constexpr std::uint32_t kGolden = 2654435769U;  // spreads consecutive rounds over the seeds
  mrpt::random::getRandomGenerator() = mrpt::random::CRandomGenerator(seed_ + kGolden * ++rounds_);
}

void Particles::reset(const Gaussian& pose) {
  seedRandom();
  auto& random = mrpt::random::getRandomGenerator();
  const Eigen::Matrix3d root = Eigen::LLT<Eigen::Matrix3d>(pose.covariance).matrixL();
  auto& particles = mcl_->m_particles;
  particles.resize(settings_.max_particles);
  for (auto& particle : particles) {
    Eigen::Vector3d unit;
    for (int i = 0; i < 3; ++i) unit(i) = random.drawGaussian1D_normalized();
    const Eigen::Vector3d off = root * unit;
    particle.log_w = 0;
    particle.d = {pose.mean.x + off(0), pose.mean.y + off(1), wrapAngle(pose.mean.theta + off(2))};
  }
}

void Particles::update(const Gaussian& motion, const std::function<double(const Pose2D&)>& log_likelihood) {
  seedRandom();
  const auto actions = action(motion);
  const mrpt::obs::CSensoryFrame frame;
  mcl_->likelihood = &log_likelihood;
  mcl_->filter.executeOn(*mcl_, &actions, &frame);
  mcl_->likelihood = nullptr;
}

std::vector<Weighted> Particles::all() const {
  std::vector<Weighted> out;
  out.reserve(mcl_->m_particles.size());
  double highest = -1e300;
  for (const auto& particle : mcl_->m_particles) highest = std::fmax(highest, particle.log_w);
  double total = 0;
  for (const auto& particle : mcl_->m_particles) {
    out.push_back({{particle.d.x, particle.d.y, particle.d.phi}, std::exp(particle.log_w - highest)});
    total += out.back().weight;
  }
  for (Weighted& each : out) each.weight /= total;
  return out;
}

Gaussian spread(const std::vector<Weighted>& poses) {
  double x = 0;
  double y = 0;
  double c = 0;
  double s = 0;
  for (const auto& [pose, weight] : poses) {
    x += weight * pose.x;
    y += weight * pose.y;
    c += weight * std::cos(pose.theta);
    s += weight * std::sin(pose.theta);
  }
  const Pose2D mean{x, y, std::atan2(s, c)};
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const auto& [pose, weight] : poses) {
    const Eigen::Vector3d off(pose.x - x, pose.y - y, wrapAngle(pose.theta - mean.theta));
    covariance += weight * off * off.transpose();
  }
  return {mean, covariance};
}

}  // namespace kurumaisu
