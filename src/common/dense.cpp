#include "dense.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>

namespace fringe_fusion::dense {

using Eigen::MatrixXd;
using Eigen::Ref;
using Eigen::VectorXd;

SymmetricEigen DecomposeSymmetric(const Ref<const MatrixXd>& A) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(A);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

VectorXd SymmetricEigenvalues(const Ref<const MatrixXd>& A) {
  return Eigen::SelfAdjointEigenSolver<MatrixXd>(A, Eigen::EigenvaluesOnly).eigenvalues();
}

SingularValues DecomposeSingular(const Ref<const MatrixXd>& A) {
  const Eigen::JacobiSVD<MatrixXd> svd(A, Eigen::ComputeThinU | Eigen::ComputeFullV);
  return {svd.matrixU(), svd.singularValues(), svd.matrixV()};
}

MatrixXd SolveSymmetric(const Ref<const MatrixXd>& A, const Ref<const MatrixXd>& B) {
  return Eigen::LDLT<MatrixXd>(A).solve(B);
}

MatrixXd Solve(const Ref<const MatrixXd>& A, const Ref<const MatrixXd>& B) {
  return Eigen::PartialPivLU<MatrixXd>(A).solve(B);
}

MatrixXd Invert(const Ref<const MatrixXd>& A) { return Eigen::PartialPivLU<MatrixXd>(A).inverse(); }

std::optional<MatrixXd> SolvePositive(const Ref<const MatrixXd>& A, const Ref<const MatrixXd>& B) {
  const Eigen::LLT<MatrixXd> factor(A);
  if (factor.info() != Eigen::Success) return std::nullopt;
  return MatrixXd(factor.solve(B));
}

VectorXd LeastSquares(const Ref<const MatrixXd>& A, const Ref<const VectorXd>& b) {
  return Eigen::ColPivHouseholderQR<MatrixXd>(A).solve(b);
}

MatrixXd PseudoInverse(const Ref<const MatrixXd>& A) {
  return Eigen::CompleteOrthogonalDecomposition<MatrixXd>(A).pseudoInverse();
}

std::optional<Constrained> SolveConstrained(const Ref<const MatrixXd>& K,
                                            const Ref<const MatrixXd>& P,
                                            const Ref<const VectorXd>& d, double rank_threshold,
                                            bool with_diagonal) {
  Eigen::ColPivHouseholderQR<MatrixXd> qr(P);
  qr.setThreshold(rank_threshold);
  const Eigen::Index rank = qr.rank();
  const Eigen::Index n = P.rows();
  const Eigen::Index rest = n - rank;
  const auto q = qr.householderQ().setLength(rank);
  MatrixXd turned = K;
  turned.applyOnTheLeft(q.adjoint());
  turned.applyOnTheRight(q);
  const Eigen::LLT<MatrixXd> cholesky(turned.bottomRightCorner(rest, rest));
  if (cholesky.info() != Eigen::Success) return std::nullopt;

  VectorXd turned_d = d;
  turned_d.applyOnTheLeft(q.adjoint());
  Constrained out;
  out.x = VectorXd::Zero(n);
  out.x.tail(rest) = cholesky.solve(turned_d.tail(rest));
  const VectorXd left = turned_d.head(rank) - turned.topRightCorner(rank, rest) * out.x.tail(rest);
  out.x.applyOnTheLeft(q);
  VectorXd coefficients = VectorXd::Zero(P.cols());
  coefficients.head(rank) =
      qr.matrixQR().topLeftCorner(rank, rank).triangularView<Eigen::Upper>().solve(left);
  out.c = qr.colsPermutation() * coefficients;
  if (!with_diagonal) return out;
  MatrixXd columns = MatrixXd::Identity(n, n);
  columns.applyOnTheLeft(q.adjoint());
  MatrixXd half = columns.bottomRows(rest);
  cholesky.matrixL().solveInPlace(half);
  out.diagonal = half.colwise().squaredNorm().transpose();
  return out;
}

MatrixXd Product(const Ref<const MatrixXd>& A, const Ref<const MatrixXd>& B) { return A * B; }

MatrixXd Propagate(const Ref<const MatrixXd>& J, const Ref<const MatrixXd>& A) {
  return J * A * J.transpose();
}

}  // namespace fringe_fusion::dense
