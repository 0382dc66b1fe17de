model Drive "a mass that a force moves against viscous friction, free or on a spring"
  parameter Real mass(min=0) = {std:input}*{time}^2/{std:output} "moved mass";
  parameter Real viscous_friction(min=0) = {std:input}*{time}/{std:output};
  parameter Real stiffness(min=0) = {std:input}/{std:output} "spring that holds the mass; 0 where it moves freely";
  parameter Real force_offset = 0 "force that is not in the input";
  input Real {input}{unit:input};
  output Real {output}{unit:output};
  Real {output:_position}(start={first});
  Real {output:_velocity}(start=0);
equation
  der({output:_position}) = {output:_velocity};
  mass*der({output:_velocity}) = {input} - viscous_friction*{output:_velocity} - stiffness*{output:_position} + force_offset;
  {output} = {output:_position};
end Drive;
