model TwoMasses "motor that drives a load over a stiffening shaft"
  parameter Real R(unit="Ohm") = 1.5 "resistance";
  parameter Real L(unit="H") = 0.03 "inductance";
  parameter Real k(unit="N.m/A") = 0.06 "torque constant, and voltage per speed";
  parameter Real J1(unit="kg.m2") = 3e-4 "inertia of the motor";
  parameter Real J2(unit="kg.m2") = 8e-4 "inertia of the load";
  parameter Real d1(unit="N.m.s/rad") = 1e-4 "friction of the motor";
  parameter Real d2(unit="N.m.s/rad") = 5e-4 "friction of the load";
  parameter Real c(unit="N.m/rad") = 0.8 "stiffness of the shaft";
  parameter Real c3(unit="N.m/rad3") = 2 "cubic stiffness of the shaft";
  parameter Real d(unit="N.m.s/rad") = 2e-4 "damping of the shaft";
  input Real u(unit="V") "voltage";
  output Real y1(unit="rad/s") "speed of the motor";
  output Real y2(unit="rad/s") "speed of the load";
  Real i(unit="A", start=0, fixed=true) "current";
  Real w1(unit="rad/s", start=0, fixed=true) "speed of the motor";
  Real w2(unit="rad/s", start=0, fixed=true) "speed of the load";
  Real phi1(unit="rad", start=0, fixed=true) "angle of the motor";
  Real phi2(unit="rad", start=0, fixed=true) "angle of the load";
  Real tau(unit="N.m") = c*(phi1 - phi2) + c3*(phi1 - phi2)^3 + d*(w1 - w2) "torque of the shaft";
equation
  L*der(i) = u - R*i - k*w1;
  J1*der(w1) = k*i - d1*w1 - tau;
  J2*der(w2) = tau - d2*w2;
  der(phi1) = w1;
  der(phi2) = w2;
  y1 = w1;
  y2 = w2;
end TwoMasses;
