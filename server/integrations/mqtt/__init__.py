"""MQTT: states, events and pictures of a site for a broker, and Home Assistant's discovery messages."""
