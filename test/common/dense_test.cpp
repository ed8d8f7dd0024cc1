#include "src/common/dense.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace fringe_fusion::dense {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kRounding = 1e-12;

MatrixXd Rectangle(Eigen::Index rows, Eigen::Index columns) {
  MatrixXd A(rows, columns);
  for (Eigen::Index i = 0; i < A.size(); ++i) A(i) = std::sin(1.0 + 2.7 * static_cast<double>(i));
  return A;
}

/// Symmetric with the given eigenvalues.
MatrixXd Symmetric(const VectorXd& values) {
  const VectorXd v = VectorXd::LinSpaced(values.size(), 0.5, 1.5).normalized();
  const MatrixXd reflection =
      MatrixXd::Identity(values.size(), values.size()) - 2.0 * v * v.transpose();
  return reflection * values.asDiagonal() * reflection;
}

MatrixXd Positive() { return Symmetric(Eigen::Vector4d(0.5, 2.0, 3.0, 7.0)); }

void ExpectNear(const MatrixXd& a, const MatrixXd& b, double tolerance = kRounding) {
  ASSERT_EQ(a.rows(), b.rows());
  ASSERT_EQ(a.cols(), b.cols());
  EXPECT_LE((a - b).cwiseAbs().maxCoeff(), tolerance) << a << "\n\n" << b;
}

TEST(Dense, DecomposesSymmetric) {
  const Eigen::Vector4d values(-1.0, 0.0, 2.0, 5.0);
  const MatrixXd A = Symmetric(values);
  const SymmetricEigen eigen = DecomposeSymmetric(A);
  ExpectNear(eigen.values, values);
  ExpectNear(SymmetricEigenvalues(A), values);
  ExpectNear(eigen.vectors * eigen.values.asDiagonal() * eigen.vectors.transpose(), A);
  ExpectNear(eigen.vectors.transpose() * eigen.vectors, MatrixXd::Identity(4, 4));
}

TEST(Dense, ReadsTheLowerHalfOfSymmetric) {
  MatrixXd lower = Positive();
  lower.triangularView<Eigen::StrictlyUpper>().setConstant(99.0);
  const MatrixXd B = Rectangle(4, 2);
  ExpectNear(SymmetricEigenvalues(lower), SymmetricEigenvalues(Positive()));
  ExpectNear(SolveSymmetric(lower, B), SolveSymmetric(Positive(), B));
  ExpectNear(SolvePositive(lower, B).value(), SolvePositive(Positive(), B).value());
}

TEST(Dense, DecomposesSingularOfAnyShape) {
  for (const MatrixXd& A : {Rectangle(6, 3), Rectangle(3, 6), Rectangle(3, 3)}) {
    const Eigen::Index k = std::min(A.rows(), A.cols());
    const SingularValues svd = DecomposeSingular(A);
    ExpectNear(svd.U * svd.values.asDiagonal() * svd.V.leftCols(k).transpose(), A);
    ExpectNear(svd.U.transpose() * svd.U, MatrixXd::Identity(k, k));
    ExpectNear(svd.V.transpose() * svd.V, MatrixXd::Identity(A.cols(), A.cols()));
    for (Eigen::Index i = 1; i < k; ++i) EXPECT_GE(svd.values[i - 1], svd.values[i]);
    EXPECT_GE(svd.values[k - 1], 0.0);
  }
}

TEST(Dense, LastRightVectorSpansTheNullSpace) {
  const MatrixXd A = Rectangle(2, 3);
  ExpectNear(A * DecomposeSingular(A).V.col(2), MatrixXd::Zero(2, 1));
}

TEST(Dense, SolvesSystems) {
  const MatrixXd X = Rectangle(4, 3);
  const MatrixXd indefinite = Symmetric(Eigen::Vector4d(-3.0, 1.0, 2.0, 4.0));
  ExpectNear(SolveSymmetric(Positive(), Positive() * X), X);
  ExpectNear(SolvePositive(Positive(), Positive() * X).value(), X);
  ExpectNear(Solve(indefinite, indefinite * X), X);
  ExpectNear(Invert(indefinite) * indefinite, MatrixXd::Identity(4, 4));
}

TEST(Dense, TakesFixedSizes) {
  const Eigen::Matrix4d A = Positive();
  const Eigen::Vector4d x(1.0, -2.0, 3.0, 0.5);
  const Eigen::Vector4d solved = SolveSymmetric(A, A * x);
  ExpectNear(solved, x);
}

TEST(Dense, PositiveFailsWhereItIsNot) {
  const MatrixXd B = Rectangle(3, 1);
  EXPECT_FALSE(SolvePositive(Symmetric(Eigen::Vector3d(-1e-3, 1.0, 2.0)), B));
  EXPECT_FALSE(SolvePositive(MatrixXd::Zero(3, 3), B));
}

TEST(Dense, SingularIsNotFinite) {
  EXPECT_FALSE(Invert(MatrixXd::Zero(3, 3)).allFinite());
  EXPECT_FALSE(Solve(MatrixXd::Zero(3, 3), Rectangle(3, 1)).allFinite());
}

TEST(Dense, SymmetricLeavesTheOpenAtZero) {
  const MatrixXd A = Eigen::Vector3d(2.0, 0.0, 4.0).asDiagonal();
  ExpectNear(SolveSymmetric(A, Eigen::Vector3d(2.0, 0.0, 8.0)), Eigen::Vector3d(1.0, 0.0, 2.0));
}

TEST(Dense, NanIsNotFinite) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const MatrixXd I = MatrixXd::Identity(3, 3);
  const MatrixXd bad = MatrixXd::Constant(3, 3, nan);
  EXPECT_FALSE(SolveSymmetric(bad, Rectangle(3, 1)).allFinite());
  EXPECT_FALSE(SolveSymmetric(I, MatrixXd::Constant(3, 1, nan)).allFinite());
  EXPECT_FALSE(SolvePositive(bad, Rectangle(3, 1)).value().allFinite());
  EXPECT_FALSE(Solve(bad, Rectangle(3, 1)).allFinite());
  EXPECT_FALSE(Invert(bad).allFinite());
}

TEST(Dense, LeastSquaresLeavesTheResidualAcross) {
  const MatrixXd A = Rectangle(6, 2);
  const VectorXd b = VectorXd::LinSpaced(6, -1.0, 4.0);
  ExpectNear(A.transpose() * (A * LeastSquares(A, b) - b), MatrixXd::Zero(2, 1));
}

TEST(Dense, PseudoInverseMeetsPenrose) {
  const MatrixXd deficient = Rectangle(6, 2) * Rectangle(2, 4);
  const MatrixXd P = PseudoInverse(deficient);
  ASSERT_EQ(P.rows(), 4);
  ASSERT_EQ(P.cols(), 6);
  ExpectNear(deficient * P * deficient, deficient);
  ExpectNear(P * deficient * P, P);
  ExpectNear((deficient * P).transpose(), deficient * P);
  ExpectNear((P * deficient).transpose(), P * deficient);
}

TEST(Dense, ConstrainedMeetsBothEquations) {
  const MatrixXd K = Symmetric(VectorXd::LinSpaced(6, 1.0, 5.0));
  const MatrixXd P = Rectangle(6, 2);
  const VectorXd d = VectorXd::LinSpaced(6, -1.0, 4.0);
  const auto solved = SolveConstrained(K, P, d, 1e-9, true);
  ASSERT_TRUE(solved.has_value());
  ExpectNear(K * solved->x + P * solved->c, d);
  ExpectNear(P.transpose() * solved->x, MatrixXd::Zero(2, 1));
  // The solution is linear in d, by the matrix whose diagonal is given.
  for (Eigen::Index i = 0; i < 6; ++i) {
    const auto column = SolveConstrained(K, P, VectorXd::Unit(6, i), 1e-9, false);
    ASSERT_TRUE(column.has_value());
    EXPECT_NEAR(column->x[i], solved->diagonal[i], kRounding);
    EXPECT_EQ(column->diagonal.size(), 0);
  }
}

TEST(Dense, ConstrainedGivesSpareColumnsNothing) {
  MatrixXd P = Rectangle(5, 3);
  P.col(2) = 0.5 * P.col(0);
  const VectorXd d = VectorXd::LinSpaced(5, -1.0, 4.0);
  const auto solved = SolveConstrained(MatrixXd::Identity(5, 5), P, d, 1e-9, false);
  ASSERT_TRUE(solved.has_value());
  ExpectNear(solved->x + P * solved->c, d);
  EXPECT_EQ((solved->c.array() == 0.0).count(), 1);
}

TEST(Dense, ConstrainedNeedsPositiveOnlyWithinTheCondition) {
  const MatrixXd K = Eigen::Vector3d(-1.0, 2.0, 3.0).asDiagonal();
  const VectorXd d = Eigen::Vector3d(1.0, 2.0, 3.0);
  EXPECT_TRUE(SolveConstrained(K, Eigen::Vector3d::UnitX(), d, 1e-9, false));
  EXPECT_FALSE(SolveConstrained(K, Eigen::Vector3d::UnitY(), d, 1e-9, false));
}

TEST(Dense, MultipliesElementByElement) {
  const MatrixXd A = Rectangle(3, 5);
  const MatrixXd B = Rectangle(5, 2);
  const MatrixXd C = Product(A, B);
  ASSERT_EQ(C.rows(), 3);
  ASSERT_EQ(C.cols(), 2);
  for (Eigen::Index i = 0; i < C.rows(); ++i) {
    for (Eigen::Index j = 0; j < C.cols(); ++j) {
      EXPECT_NEAR(C(i, j), A.row(i).dot(B.col(j)), kRounding);
    }
  }
}

TEST(Dense, PropagatesCovariance) {
  const MatrixXd J = Rectangle(2, 4);
  ExpectNear(Propagate(J, Positive()), J * Positive() * J.transpose());
}

}  // namespace
}  // namespace fringe_fusion::dense
