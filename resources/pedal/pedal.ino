// Foot pedal of LumenPilot. hardware/inputs/pedal.py describes the line, docs/bench.md the wiring.
const byte DEADMAN = 2, STOP = 3, ESTOP = 4;  // each switch lies between its pin and GND
const bool HAS_ESTOP = false;             // true: the E-stop button's second contact lies at ESTOP
byte number = 0, held = 0, opened = 0, stop = 0;
unsigned long sent_ms = 0;

void setup() {
  pinMode(DEADMAN, INPUT_PULLUP);
  pinMode(STOP, INPUT_PULLUP);
  pinMode(ESTOP, INPUT_PULLUP);
  Serial.begin(115200);
}

void loop() {                             // once a millisecond
  held = digitalRead(DEADMAN) == LOW ? min(held + 1, 10) : 0;   // held after 10 ms, released at once
  opened = digitalRead(STOP) == HIGH ? min(opened + 1, 3) : 0;  // a spark of 1 ms is no STOP
  if (opened == 3) stop = 5;              // but a short press is told in five reports
  if (millis() - sent_ms >= 20) {
    sent_ms = millis();
    byte button = HAS_ESTOP && digitalRead(ESTOP) == HIGH ? 'E' : stop ? 'S' : '-';
    byte line[7] = {'P', byte(0x40 | (number++ & 31)), byte(held == 10 ? 'D' : '-'), button, 0, 0, '\n'};
    byte crc = 0;
    for (byte i = 0; i < 4; i++) {
      crc ^= line[i];
      for (byte bit = 0; bit < 8; bit++) crc = crc & 0x80 ? (crc << 1) ^ 0x07 : crc << 1;
    }
    line[4] = 0x40 | (crc >> 4);
    line[5] = 0x40 | (crc & 15);
    Serial.write(line, 7);
    if (stop) stop--;
  }
  delay(1);
}
