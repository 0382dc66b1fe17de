model HeatedMass "block with a heater element in it, in open air"
  final parameter Real Ch(unit="J/K") = 42 "heat capacity of the element, from its mass";
  parameter Real Cb(unit="J/K", min=200, max=1000) = 500 "heat capacity of the block";
  parameter Real G(unit="W/K", min=0.5, max=10) = 3 "conductance from the element to the block";
  parameter Real hA(unit="W/K", min=0.05, max=1) = 0.4 "convection, times the surface";
  parameter Real eps(unit="1", min=0.2, max=1) = 0.6 "emissivity";
  final parameter Real A(unit="m2") = 0.03 "surface, measured";
  input Real P(unit="W") "power of the heater";
  input Real Ta(unit="K") "temperature of the air and of the walls";
  output Real T(unit="K") "thermocouple in the block";
  Real Th(unit="K", start=300, min=0) "temperature of the element";
  Real Tb(unit="K", start=300, min=0) "temperature of the block";
  Real Qr(unit="W") = eps*A*Modelica.Constants.sigma*(Tb^4 - Ta^4) "radiation";
equation
  Ch*der(Th) = P - G*(Th - Tb);
  Cb*der(Tb) = G*(Th - Tb) - hA*(Tb - Ta) - Qr;
  T = Tb;
end HeatedMass;
