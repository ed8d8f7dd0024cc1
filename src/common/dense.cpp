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

MatrixXd Product(const Ref<const MatrixXd>& A, const Ref<const MatrixXd>& B) { return A * B; }

MatrixXd Propagate(const Ref<const MatrixXd>& J, const Ref<const MatrixXd>& A) {
  return J * A * J.transpose();
}

}  // namespace fringe_fusion::dense
