model Speed "the speed of a mass that a force moves against viscous friction"
  parameter Real mass(min=0) = {std:input}*{time}/{std:output} "moved mass";
  parameter Real viscous_friction(min=0) = {std:input}/{std:output};
  parameter Real force_offset = 0 "force that is not in the input";
  input Real {input}{unit:input};
  output Real {output}{unit:output};
  Real {output:_velocity}(start={first});
equation
  mass*der({output:_velocity}) = {input} - viscous_friction*{output:_velocity} + force_offset;
  {output} = {output:_velocity};
end Speed;
