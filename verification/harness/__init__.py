# SPDX-License-Identifier: MIT
"""What the cases of the verification suite share: runs of `itr`, references, reports."""
