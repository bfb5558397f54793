"""SUNDIALS' CVODE and IDA: in machine code alone where their C libraries are found, else through scikit-sundae."""
