! SPDX-License-Identifier: MIT
! The C interface from Fortran: a strip hangs from its top, pulled down by forces on the vertices of its lower end; at rest
! the top holds their sum.
program hanging
  use, intrinsic :: iso_c_binding
  implicit none
  interface
    function itr_model_create(dimension) bind(c) result(model)
      import; integer(c_int), value :: dimension; type(c_ptr) :: model
    end function
    subroutine itr_model_destroy(model) bind(c)
      import; type(c_ptr), value :: model
    end subroutine
    function itr_model_set_mesh(model, nv, vertices, nc, cells, bodies) bind(c) result(status)
      import; type(c_ptr), value :: model, bodies; integer(c_size_t), value :: nv, nc
      real(c_double) :: vertices(*); integer(c_int) :: cells(*), status
    end function
    function itr_model_add_boundary_box(model, name, low, high, id) bind(c) result(status)
      import; type(c_ptr), value :: model, id; character(c_char) :: name(*)
      real(c_double) :: low(*), high(*); integer(c_int) :: status
    end function
    function itr_model_set_options(model, json) bind(c) result(status)
      import; type(c_ptr), value :: model; character(c_char) :: json(*); integer(c_int) :: status
    end function
    function itr_simulation_create(model, log, user, simulation) bind(c) result(status)
      import; type(c_ptr), value :: model, user; type(c_funptr), value :: log
      type(c_ptr) :: simulation; integer(c_int) :: status
    end function
    subroutine itr_simulation_destroy(simulation) bind(c)
      import; type(c_ptr), value :: simulation
    end subroutine
    function itr_fix_values(simulation, boundary, mask, length, displacements) bind(c) result(status)
      import; type(c_ptr), value :: simulation; character(c_char) :: boundary(*)
      integer(c_int) :: mask(*), status; integer(c_size_t), value :: length; real(c_double) :: displacements(*)
    end function
    function itr_set_forces(simulation, length, forces) bind(c) result(status)
      import; type(c_ptr), value :: simulation; integer(c_size_t), value :: length
      real(c_double) :: forces(*); integer(c_int) :: status
    end function
    function itr_watch_forces(simulation, watched) bind(c) result(status)
      import; type(c_ptr), value :: simulation; integer(c_int), value :: watched; integer(c_int) :: status
    end function
    function itr_step(simulation, dt) bind(c) result(status)
      import; type(c_ptr), value :: simulation; real(c_double), value :: dt; integer(c_int) :: status
    end function
    function itr_positions(simulation) bind(c) result(x)
      import; type(c_ptr), value :: simulation; type(c_ptr) :: x
    end function
    function itr_resultant(simulation, boundary, about, force, moment) bind(c) result(status)
      import; type(c_ptr), value :: simulation; character(c_char) :: boundary(*)
      real(c_double) :: about(*), force(*), moment(*); integer(c_int) :: status
    end function
  end interface
  integer, parameter :: n = 10
  real(c_double) :: vertices(2, 0:2*n+1), zero(2, 0:2*n+1), forces(2, 0:2*n+1), force(2), moment(1)
  real(c_double), pointer :: x(:, :)
  integer(c_int) :: cells(3, 2*n)
  type(c_ptr) :: model, simulation
  integer :: i
  do i = 0, n
    vertices(:, 2*i) = [0d0, -0.1d0*i]
    vertices(:, 2*i+1) = [0.1d0, -0.1d0*i]
  end do
  do i = 1, n
    cells(:, 2*i-1) = [2*i-2, 2*i, 2*i+1]
    cells(:, 2*i) = [2*i-2, 2*i+1, 2*i-1]
  end do
  zero = 0; forces = 0
  forces(2, 2*n:2*n+1) = -5
  model = itr_model_create(2)
  call check(itr_model_set_mesh(model, 2_c_size_t*n+2, vertices, 2_c_size_t*n, cells, c_null_ptr))
  call check(itr_model_add_boundary_box(model, "top"//c_null_char, [0d0, 0d0], [1d0, 0d0], c_null_ptr))
  call check(itr_model_set_options(model, '{"materials": {"type": "NeoHookean", "E": 1e4, "nu": 0.3, "rho": 1},' // &
    '"time": {"dt": 1, "time_steps": 1, "quasistatic": true}, "solver": {"nonlinear": {"grad_norm": 1e-9}}}'//c_null_char))
  call check(itr_simulation_create(model, c_null_funptr, c_null_ptr, simulation))
  call itr_model_destroy(model)
  call check(itr_fix_values(simulation, "top"//c_null_char, [1, 1], size(zero, kind=c_size_t), zero))
  call check(itr_set_forces(simulation, size(forces, kind=c_size_t), forces))
  call check(itr_watch_forces(simulation, 1))
  call check(itr_step(simulation, 0d0))
  call check(itr_resultant(simulation, "top"//c_null_char, [0d0, 0d0], force, moment))
  call c_f_pointer(itr_positions(simulation), x, [2, 2*n+2])
  print '(a, f9.5, a, f9.5, a)', "the lower end is at", x(2, 2*n+1), " m, the top holds", force(2), " N"
  if (abs(force(2) - 10) > 1d-6 .or. x(2, 2*n+1) > -1.001) error stop 1
  call itr_simulation_destroy(simulation)
contains
  subroutine check(status)
    integer(c_int), intent(in) :: status
    if (status /= 0) error stop 2
  end subroutine
end program
